"""What finished runs are asked for, and what unfinished ones are told."""

import json
import shlex
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from cospeech.corpus.manifest import write_manifest
from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation import standard_catalogue
from cospeech.experiment import evaluate, generate, generating, own_or_given
from cospeech.experiment.finished_run import load, open_run
from cospeech.methods.capabilities import HasSchedule
from cospeech.nn.checkpoints import previous_of
from tests.corpora import make_recording
from tests.runs import FINGERPRINT, METHODS, Outputs, command, read_record, write_record
from tests.trainings import done


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return Outputs(tmp_path_factory.mktemp("outputs"))


@pytest.fixture
def run(outputs, request):
    return outputs.run("multi_adversary", below=f"of{id(request.node)}", stage="finished")


def spoken(outputs, run, made, *more):
    given = (f"run={run}", f"audio={outputs.audio}", f"run_dir={made}")
    with command("generate", *given, f"outputs_dir={outputs.folder}", *more) as cfg:
        return generate(cfg)


def judged(outputs, run, made, *more):
    with command("evaluate", f"run={run}", f"run_dir={made}", *more) as cfg:
        return evaluate(cfg)


@pytest.mark.parametrize("status", ["interrupted", "running", "failed"])
def test_a_run_that_did_not_end_speaks_only_if_last_is_said(status, outputs, run, tmp_path):
    write_record(run, read_record(run) | {"status": status})
    for ask in (spoken, judged):
        with pytest.raises(ConfigError) as caught:
            ask(outputs, run, tmp_path)
        assert "has not come to its end" in caught.value.problem
        assert "ckpt_path=last" in caught.value.hint
        assert "checkpoint=last" in caught.value.hint
    assert len(spoken(outputs, run, tmp_path, "checkpoint=last")) == 60


def test_an_untrained_generator_is_not_the_best(outputs, tmp_path):
    """A run may be said to have ended by training.epochs before its last stage began."""
    run = outputs.run("multi_adversary", below="early", stage="pretraining")
    for ask in (spoken, judged):
        with pytest.raises(ConfigError) as caught:
            ask(outputs, run, tmp_path)
        assert "no epoch of the last stage of its training is done" in caught.value.problem
    assert len(spoken(outputs, run, tmp_path, "checkpoint=last")) == 60
    with (
        command(
            "evaluate",
            f"runs={run.parent}",
            "study=multi_adversary_figures",
            "checkpoint=best",
            f"run_dir={tmp_path}",
            f"outputs_dir={outputs.folder}",
        ) as cfg,
        pytest.raises(ConfigError, match="no epoch of the last stage"),
    ):
        evaluate(cfg)


def test_nobody_speaks_where_the_transcript_is_empty(outputs, tmp_path, caplog):
    run = outputs.run("trimodal", below="said")
    empty = tmp_path / "empty.txt"
    empty.write_text("\n")
    assert len(spoken(outputs, run, tmp_path, f"transcript={empty}"))
    assert f"{empty}: the file is empty: nobody speaks" in caplog.messages


def test_methods_with_stages_declare_where_they_stand(outputs):
    for name, (kind, arguments) in METHODS.items():
        method = kind(outputs.facts, **arguments)
        assert isinstance(method, HasSchedule) == (name == "multi_adversary")


def test_a_run_is_named_in_several_ways(outputs, run, monkeypatch):
    monkeypatch.chdir(run.parent)
    with command("generate"):
        for name in (run, "run", "./run/", "run/record.json", f"{run}/record.json"):
            assert open_run(name).id == "run"
        with pytest.raises(ConfigError) as caught:
            open_run("run/checkpoints/last.ckpt")
        assert "run=run checkpoint=best (or last)" in caught.value.hint
        with pytest.raises(ConfigError, match=r"no record\.json there") as caught:
            open_run(run.parent)
        assert f"run={run}" in caught.value.hint
        with pytest.raises(ConfigError, match=r"run=nowhere: no record\.json"):
            open_run("nowhere")
        with pytest.raises(ConfigError, match="is not one of best, last"):
            open_run("run", "newest")


def test_the_motion_is_kept_where_the_page_fails(outputs, run, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(generating, "write_player", full)
    with pytest.raises(CospeechError, match="the motion is whole") as caught:
        spoken(outputs, run, tmp_path)
    assert str(tmp_path / "motion.npz") in str(caught.value)
    assert np.load(tmp_path / "motion.npz")["positions"].shape == (60, 10, 3)


def test_weights_of_a_training_that_diverged_leave_no_motion(outputs, tmp_path):
    run = outputs.run("trimodal", below="diverged")
    for checkpoint in run.glob("checkpoints/*.ckpt"):
        content = torch.load(checkpoint, weights_only=False)
        for values in content["state_dict"].values():
            if values.is_floating_point():
                values.fill_(torch.nan)
        torch.save(content, checkpoint)
    with pytest.raises(CospeechError, match="the motion holds NaN") as caught:
        spoken(outputs, run, tmp_path / "made")
    assert "checkpoint=last" in caught.value.hint
    assert not (tmp_path / "made").exists()


def test_a_file_name_that_is_no_text_has_a_page(outputs, tmp_path):
    recording = make_recording("a", seconds=2)
    told = generating._written(recording.motion, recording.speech, tmp_path, "a\udcff", 1.0)
    assert str(tmp_path / "player.html") in told
    assert "a?" in (tmp_path / "player.html").read_text()


def test_a_method_without_a_database_takes_none(outputs, run, tmp_path):
    with pytest.raises(ConfigError, match="multi_adversary has no database"):
        spoken(outputs, run, tmp_path, "database=somewhere")


def test_the_corpus_is_found_where_the_outputs_went(outputs, tmp_path):
    run = outputs.run("knn", below="here")
    moved = tmp_path / "moved"
    shutil.copytree(run, moved / "runs" / "run")
    shutil.copytree(outputs.store, moved / "stores" / outputs.store.name)
    with command("generate"):
        opened = open_run(moved / "runs" / "run")
    assert opened.find_store([tmp_path / "none"]).path.parent == moved / "stores"
    assert opened.find_store([outputs.store.parent]).path == outputs.store
    method = opened.load(opened.find_store([]))
    assert method._store == str(moved / "stores" / outputs.store.name)
    # A folder of the name alone doesn't do.
    manifest = moved / "stores" / outputs.store.name / "manifest.json"
    values = json.loads(manifest.read_text())
    write_manifest(manifest.parent, values | {"fingerprint": FINGERPRINT[:-1] + "1"})
    assert opened.find_store([]) is None


def test_no_corpus_is_looked_for_above_the_outputs(outputs, tmp_path):
    run = outputs.run("trimodal", below="deep")
    for depth, found in (("outputs/studies/name/run", True), ("mine/outputs/a/b/run", False)):
        home = tmp_path / depth.partition("/")[0]
        shutil.copytree(run, tmp_path / depth)
        shutil.copytree(outputs.store, home / "stores" / outputs.store.name)
        with command("generate"):
            assert (open_run(tmp_path / depth).find_store([]) is not None) == found


@pytest.mark.parametrize("damage", ["empty", "absent"])
def test_the_last_checkpoint_is_the_one_before_where_it_is_damaged(
    damage, outputs, run, tmp_path, caplog
):
    last = run / "checkpoints" / "last.ckpt"
    last.rename(previous_of(last))
    if damage == "empty":
        last.touch()
    for ask in (spoken, judged):
        caplog.clear()
        ask(outputs, run, tmp_path, "checkpoint=last")
        (said,) = [text for text in caplog.messages if "taking the checkpoint before" in text]
        assert str(last) in said
        assert str(previous_of(last)) in said
    previous_of(last).rename(tmp_path / "elsewhere")
    previous_of(last).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(CospeechError, match="link to something outside"):
        spoken(outputs, run, tmp_path, "checkpoint=last")
    previous_of(last).unlink()
    with pytest.raises(CospeechError, match=r"is empty|no checkpoints/last\.ckpt") as caught:
        spoken(outputs, run, tmp_path, "checkpoint=last")
    assert "checkpoint=best takes best.ckpt" in caught.value.hint


def test_a_corpus_that_is_gone_is_not_made_again_on_a_strangers_word(outputs, run, tmp_path):
    """What would make it is told, for the user to type."""
    record = read_record(run)
    record["data_fingerprint"] = "1" * 64
    record["config"]["data"] |= {"store_dir": str(tmp_path / "stores"), "speakers": 3}
    record["config"]["metrics"] |= {"encoder": "trained", "encoder_epochs": 7, "reference_seed": 2}
    write_record(run, record)
    with pytest.raises(ConfigError, match="its prepared corpus isn't here") as caught:
        judged(outputs, run, tmp_path / "made", f"outputs_dir={tmp_path}")
    assert "data=synthetic data.minutes=4 data.speakers=3" in caught.value.hint
    assert "store_dir=/" not in caught.value.hint
    # With the corpus back, the encoder has to be trained again too: all of it is said at once.
    own = "metrics.encoder=trained metrics.encoder_epochs=7 metrics.reference_seed=2 data="
    assert own in caught.value.hint
    assert list(tmp_path.iterdir()) == []


def test_a_search_whose_corpus_is_gone_tells_what_makes_it_again(outputs, tmp_path):
    run = outputs.run("knn", below="gone")
    record = read_record(run)
    record["data_fingerprint"] = "1" * 64
    labels = {"é": "stroke", "go": "hold"}
    record |= {"data": "mocap"}
    record["config"]["data"] = {
        "_target_": "data_modules.mocap.MocapData",
        "root": "/a b",
        "licence": "null",
        "speaker": "12",
        "phase_labels": labels,
    }
    write_record(run, record)
    with pytest.raises(ConfigError, match="its prepared corpus isn't here") as caught:
        spoken(outputs, run, tmp_path / "made")
    told = caught.value.hint.partition("make it again: ")[2]
    typed = shlex.split(told.partition(", with ")[0])
    assert typed[:2] == ["python", "prepare.py"]
    with command("prepare", *typed[2:]) as cfg:
        assert cfg.data.store_dir == str(outputs.folder / "stores")
        assert (cfg.data.root, cfg.data.licence, cfg.data.speaker) == ("/a b", "null", "12")
    # No key of a mapping can be quoted.
    assert told.endswith(", with data.phase_labels as in its record.json")
    record["config"]["data"]["phase_labels"].pop("é")
    write_record(run, record)
    with pytest.raises(ConfigError) as caught:
        spoken(outputs, run, tmp_path / "made")
    assert "'data.phase_labels={go: hold}'" in caught.value.hint


def test_a_search_finds_its_corpus_or_a_database_where_it_is_said_to_be(outputs, tmp_path):
    run = outputs.run("knn", below="apart").rename(tmp_path / "run")

    with pytest.raises(ConfigError, match="its prepared corpus isn't here"):
        load(run)
    assert load(run, store_folders=[outputs.store.parent])._store == str(outputs.store)
    assert load(run, database="/kept")._folder == "/kept"
    record = read_record(run)
    record["config"]["model"]["database"] = "/named/in/training"
    write_record(run, record)
    load(run)


def test_an_encoder_that_is_gone_is_not_trained_for_as_long_as_a_record_says(
    outputs, run, tmp_path
):
    record = read_record(run)
    record["config"]["metrics"] |= {"encoder": "trained", "encoder_epochs": 10**9}
    write_record(run, record)
    with pytest.raises(ConfigError, match="isn't kept beside") as caught:
        judged(outputs, run, tmp_path, f"outputs_dir={outputs.folder}")
    assert "metrics.encoder=trained metrics.encoder_epochs=1000000000" in caught.value.hint
    assert "or judge with metrics.encoder=packaged" in caught.value.hint


@pytest.mark.parametrize(("data", "usual"), [("synthetic", "packaged"), ("mocap", "trained")])
def test_a_run_is_judged_by_its_own_encoder_or_by_what_is_usual_for_its_corpus(
    data, usual, outputs, run, monkeypatch
):
    record = read_record(run)
    if data == "mocap":
        record["config"]["data"] = {"_target_": "data_modules.mocap.MocapData", "root": "x"}
    by_its_own = {"encoder": "trained", "encoder_epochs": 60}  # as before any was packaged
    record["config"]["metrics"] |= by_its_own
    write_record(run, record | {"data": data})
    monkeypatch.setattr(own_or_given, "chosen_encoder", lambda store, metrics: metrics.encoder)
    for typed, encoder in (
        ([], "trained"),
        (["metrics.reference_seed=3"], usual),
        (["metrics.reference_seed=3", "data.store_dir=stores"], usual),
        (["metrics.encoder=mine.pt"], "mine.pt"),
    ):
        monkeypatch.setattr(own_or_given, "_overrides", lambda typed=typed: typed)
        with command("evaluate", f"run={run}", *typed) as cfg:
            found, metrics = own_or_given.encoder_of(open_run(run), cfg, outputs.store)
        assert found == metrics.encoder == encoder, typed


MINE = """\
defaults: [default]
{more}
catalogue:
  loud: {{_target_: cospeech.metrics.joint_mae.JointMAE}}
"""


@pytest.fixture
def chosen(tmp_path):
    """Yaml files of metrics of a user's own."""
    (tmp_path / "conf" / "metrics").mkdir(parents=True)
    for name, more in (("mine", ""), ("same", "encoder_epochs: 60"), ("other", "encoder: a.pt")):
        path = tmp_path / "conf" / "metrics" / f"{name}.yaml"
        path.write_text(MINE.format(more=more))
    (tmp_path / "conf" / "metrics" / "upon.yaml").write_text("defaults: [other]\n")
    return f"hydra.searchpath=[{tmp_path / 'conf'}]"


def test_which_metrics_there_are_says_nothing_of_the_encoder(chosen, monkeypatch):
    monkeypatch.setattr(own_or_given, "_search_path", lambda: [chosen])
    with command("evaluate", chosen):
        for typed, says_how in (
            ("~metrics.catalogue.joint_mae", False),
            ("+metrics.catalogue.encoder._target_=mine.Loudness", False),
            ("++metrics.catalogue.x={_target_: mine.Loudness}", False),
            ("metrics.catalogue.fgd=null", False),
            ("~metrics.catalogue", False),
            ("~metrics.encoder", False),
            ("data.encoder=packaged", False),
            ("metrics=mine", False),
            ("metrics=same", False),
            ("metrics=other", True),
            ("metrics=upon", True),
            ("metrics.encoder=a.pt", True),
            ("+metrics.encoder=a.pt", True),
            ("++metrics.encoder_seed=0", True),
            ("metrics.encoder_epochs=60", True),
        ):
            monkeypatch.setattr(own_or_given, "_overrides", lambda typed=typed: ["run=a", typed])
            assert own_or_given._says_how_to_judge() is says_how, typed


@pytest.mark.parametrize("typed", ["~metrics.catalogue.acceleration_error", "metrics=mine"])
def test_a_choice_of_metrics_leaves_the_runs_encoder(
    typed, outputs, run, chosen, tmp_path, monkeypatch
):
    def judging(cfg):
        return own_or_given.encoder_of(open_run(run), cfg, outputs.store)

    monkeypatch.setattr(own_or_given, "chosen_encoder", lambda store, metrics: metrics.encoder)
    given = (chosen, f"run={run}", f"hydra.run.dir={tmp_path / 'made'}", typed)
    encoder, _ = done("evaluate", judging, outputs.folder, given)
    assert encoder == str(outputs.encoder)


def test_metrics_of_a_run_that_the_command_lacks_are_told(
    outputs, run, chosen, tmp_path, monkeypatch, caplog
):
    (tmp_path / "conf" / "metrics" / "broken.yaml").write_text("defaults: [nowhere]\n{")
    monkeypatch.setattr(own_or_given, "names_of", lambda group: ["broken", "mine"])
    monkeypatch.setattr(own_or_given, "_search_path", lambda: [chosen])
    lacks = "which this command doesn't name: add"
    line = "+metrics.catalogue.{}._target_=..."
    for names, typed, said in (
        (["fgd", "fgd_extrapolated", "joint_mae"], ["~metrics.catalogue.fgd"], None),
        (["fgd", "loud"], ["metrics=mine"], None),
        (["fgd", "loud"], ["metrics=mine", "~metrics.catalogue.loud"], None),
        (["fgd", "loud"], [], f"also judged by loud, {lacks} metrics=mine"),
        (["a", "b"], [], f"also judged by a, b, {lacks} {line.format('a')} {line.format('b')}"),
        (["$(rm -r /)"], [], f"$(rm -r /), {lacks} their lines to a yaml in conf/metrics"),
        ([f"m{i}" for i in range(300)], [], f"by m0, m1, m2, m3, m4 and 295 more, {lacks}"),
    ):
        caplog.clear()
        columns = [{"key": name, "title": name, "better": None} for name in names]
        write_record(run, read_record(run) | {"metrics": columns})
        monkeypatch.setattr(own_or_given, "_overrides", lambda typed=typed: typed)
        with command("evaluate", chosen, *typed) as cfg:
            own_or_given.catalogue_of(open_run(run), cfg)
        told = [text for text in caplog.messages if "also judged" in text]
        assert len(told) == (said is not None), names
        assert "\n" not in "".join(told)
        assert (said or "") in "".join(told)


def test_a_run_is_judged_by_the_metrics_of_the_command(outputs, run, tmp_path, caplog):
    write_record(run, read_record(run) | {"metrics": [{"key": "os.system"}]})
    judged(outputs, run, tmp_path / "made")
    assert "also judged by os.system, which" in caplog.text
    values = json.loads((tmp_path / "made" / "evaluation.json").read_text())
    assert values["metrics"] == standard_catalogue().described()


def test_a_split_that_is_none_is_named_before_anything_slow(outputs, run, tmp_path):
    for more in ((), ("study=fgd_noise",)):
        with pytest.raises(ConfigError, match="split=tst is not one of train, val, test"):
            judged(outputs, run, tmp_path, "split=tst", *more)


def test_a_study_of_a_corpus_takes_no_run(outputs, run, tmp_path):
    with pytest.raises(ConfigError, match="this study is of a corpus"):
        judged(outputs, run, tmp_path, "study=fgd_noise")


def test_a_corpus_that_is_given_has_to_be_the_runs(outputs, run, tmp_path, monkeypatch):
    typed = ["run=x", "data=mocap", "+data.root=a", "data.store_dir=b", "metrics.encoder=c"]
    typed += ["~data.workers"]
    monkeypatch.setattr(own_or_given, "_overrides", lambda: typed)
    assert own_or_given.given("data", "store_dir", "workers") == ["data=mocap", "+data.root=a"]
    assert own_or_given.given("metrics") == ["metrics.encoder=c"]
    assert own_or_given.given("dat") == []
    other = SimpleNamespace(prepare_store=lambda: SimpleNamespace(fingerprint=64 * "1"))
    monkeypatch.setattr(own_or_given, "build", lambda _: other)
    with pytest.raises(
        ConfigError, match=r"data=mocap .*: that isn't the corpus of run="
    ) as caught:
        judged(outputs, run, tmp_path)
    assert "leave data out" in caught.value.hint
