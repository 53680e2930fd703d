"""A run's folder may be a stranger's: whatever its files say, nothing of it runs."""

import functools
import json
import multiprocessing
import os
import resource
import sys
from pathlib import Path
from typing import get_type_hints

import pytest
import torch
from hydra.utils import get_class
from omegaconf import OmegaConf

from cospeech.errors import CospeechError
from cospeech.experiment import evaluate, finished_run, generate
from cospeech.experiment.finished_run import open_run
from cospeech.experiment.known_parts import known_part, names_of
from cospeech.experiment.plain_arguments import argument_names, require_arguments
from tests.runs import CONF, METHODS, Outputs, command, read_record, write_record

CANARY = "canary.txt"
STAGES = {"multi_adversary": "finished"}
HOSTILE = Path(__file__).resolve().parents[1] / "data" / "hostile"


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return Outputs(tmp_path_factory.mktemp("outputs"))


@pytest.fixture
def alive(tmp_path, monkeypatch):
    """Many ways to touch a file; the test fails where one of them was taken."""
    canary = tmp_path / CANARY
    module = tmp_path / "strangers_module.py"
    module.write_text(
        f"open({str(canary)!r}, 'w').close()\n"
        "from cospeech.methods.trimodal import Trimodal\n"
        "class Stranger(Trimodal):\n    pass\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("CANARY", str(canary))
    OmegaConf.register_new_resolver("canary", lambda *_: canary.touch() or 1, replace=True)
    yield canary
    OmegaConf.clear_resolver("canary")
    assert not canary.exists()
    assert "strangers_module" not in sys.modules


WAYS = {
    "a function as the corpus": ("data", "_target_", "os.system"),
    "a function as the method": ("model", "_target_", "os.system"),
    "a module of the stranger's": ("model", "_target_", "strangers_module.Stranger"),
    "its data module": ("data", "_target_", "strangers_module.Stranger"),
    "a method of a class of ours": (
        "model",
        "_target_",
        "cospeech.methods.trimodal.Trimodal.load_from_checkpoint",
    ),
    "a function of ours": ("data", "_target_", "cospeech.reporting.record.write_json"),
    "a command of ours": ("model", "_target_", "cospeech.experiment.prepare"),
    "a class of ours that is no method": ("model", "_target_", "cospeech.corpus.store.Store"),
    "the data modules' base": ("data", "_target_", "data_modules.base.StoreDataModule"),
    "an optimiser": ("model", "_target_", "torch.optim.Adam"),
    "a longer path": ("model", "_target_", "cospeech.methods.trimodal.Trimodal.__init__"),
    "no path at all": ("model", "_target_", ["os.system"]),
    "another list of our classes": ("data", "_target_", "cospeech.methods.trimodal.Trimodal"),
    "a target inside": ("data", "minutes", {"_target_": "pathlib.Path.touch", "self": CANARY}),
    "a target in a list": ("model", "pretraining_dropout", [{"_target_": "os.getcwd"}]),
    "a target far inside": (
        "model",
        "adversaries",
        {"phase": {"weight": {"_target_": "os.abort"}}},
    ),
    "a target in the judging": ("metrics", "encoder", {"_target_": "os.getcwd"}),
    "partial": ("model", "_partial_", True),
    "arguments by place": ("data", "_args_", [CANARY]),
    "conversion": ("model", "_convert_", "all"),
    "recursion": ("data", "_recursive_", True),
    "an environment variable": ("data", "store_dir", "${oc.env:CANARY}"),
    "decoding": ("data", "minutes", '${oc.decode:"${canary:}"}'),
    "a resolver": ("data", "speakers", "${canary:}"),
    "a resolver in the judging": ("metrics", "encoder", "${canary:}"),
    "a resolver in a key": ("model", "${canary:}", 1),
    "Hydra's resolver": ("data", "split", "${hydra:runtime.cwd}"),
    "our resolver": ("data", "store_dir", "${run_folder:run,a,b,c}"),
    "a key with dots": ("data", "a._target_", "os.getcwd"),
    "an unknown argument": ("model", "callback", "os.system"),
    "another name of the same kind": ("data", "_target_", "data_modules.mocap.MocapData"),
    "an unknown argument of the corpus": ("data", "command", f"touch {CANARY}"),
    "a path in the place of a number": ("metrics", "encoder_epochs", "../../../canary"),
    "a terminal's command in the place of a number": ("data", "minutes", "\x1b[2J\nerror: fake"),
}


COMMANDS = {
    "generate": (generate, "generate", ("run={run}", "audio={audio}")),
    "evaluate": (evaluate, "evaluate", ("run={run}",)),
    "a study of a run": (evaluate, "evaluate", ("run={run}", "study=control_adherence")),
    "a study of runs": (evaluate, "evaluate", ("runs={runs}", "study=multi_adversary_figures")),
}
"""Every command that takes a finished run."""


def ask(name: str, outputs: Outputs, run: Path, made: Path, *more: str):
    task, script, overrides = COMMANDS[name]
    places = {"run": run, "runs": run.parent, "audio": outputs.audio}
    given = [override.format(**places) for override in overrides]
    common = (f"outputs_dir={outputs.folder}", f"run_dir={made}")
    with command(script, *given, *common, *more) as cfg:
        return task(cfg)


@pytest.fixture
def foreign(outputs, request):
    """A run of its own for each test, which the test may spoil."""
    return outputs.run("multi_adversary", below=f"of{id(request.node)}", stage="finished")


@pytest.mark.parametrize("way", WAYS)
def test_no_way_in_through_the_record(way, outputs, foreign, tmp_path, alive, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = read_record(foreign)
    part, key, value = WAYS[way]
    record["config"][part][key] = value
    write_record(foreign, record)
    before = sorted(outputs.folder.rglob("*"))
    for name in COMMANDS:
        with pytest.raises(CospeechError) as caught:
            ask(name, outputs, foreign, tmp_path / "made")
        if name != "a study of runs":  # which leaves it out with a warning
            assert str(foreign / "record.json") in str(caught.value), name
            assert len(str(caught.value)) < 1500
    assert sorted(outputs.folder.rglob("*")) == before
    assert [path.name for path in tmp_path.iterdir()] == ["strangers_module.py"]


def test_a_sound_run_speaks_and_is_judged(outputs, foreign, tmp_path, alive):
    """So that what is refused above is refused for the one thing that was changed."""
    assert ask("generate", outputs, foreign, tmp_path / "made").positions.shape == (60, 10, 3)
    final = ask("evaluate", outputs, foreign, tmp_path / "made")
    assert final["recordings"]["fgd"] > 0
    values = json.loads((tmp_path / "made" / "evaluation.json").read_text())
    assert (values["id"], values["checkpoint"]) == ("run", "best")


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("linked", ["record.json", "checkpoints", "checkpoints/best.ckpt"])
def test_a_link_out_of_the_folder_is_not_followed(name, linked, outputs, foreign, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (foreign / linked).rename(elsewhere)
    (foreign / linked).symlink_to(elsewhere)
    checkpoint = () if name == "generate" else ("checkpoint=best",)
    with pytest.raises(CospeechError) as caught:
        ask(name, outputs, foreign, tmp_path / "made", *checkpoint)
    if name != "a study of runs":
        assert "link to something outside the run's folder" in str(caught.value)


class Bomb:
    def __reduce__(self):
        return Path.touch, (Path(os.environ["CANARY"]),)


OF_OURS = "cospeech.methods.multi_adversary"

CHECKPOINTS = {
    "an instantiator": ({"_instantiator": "strangers_module.Stranger"}, "_instantiator"),
    "an unknown argument": ({"callback": "os.system"}, "callback"),
    "an object": ({"labels": {1, 2}}, ""),
    "a target": ({"adversaries": {"phase": {"_target_": "os.getcwd"}}}, "_target_"),
    "a stranger's adversary": (
        {"adversaries": {"phase": {"class": "strangers_module.Stranger", "weight": 1}}},
        f"is no class of {OF_OURS}",
    ),
    "a class of ours that is no adversary": (
        {"adversaries": {"phase": {"class": f"{OF_OURS}.generation.Tally", "weight": 1}}},
        "is no subclass of",
    ),
    "an interpolation": ({"products_dir": "${canary:}"}, "interpolation"),
    "a number as text": ({"run": "2"}, "run='2' is not int"),
    "a width without end": ({"hidden_size": 10**9}, ""),
    "more snapshots than there are steps": ({"snapshots": 10**9}, "snapshots"),
    "another width": ({"hidden_size": 9}, ""),
    "no corpus": ({"corpus": {}}, "corpus"),
    "a corpus of another kind": ({"corpus": None}, "corpus"),
}


@pytest.mark.parametrize("what", CHECKPOINTS)
def test_no_way_in_through_the_settings_in_a_checkpoint(what, outputs, foreign, tmp_path, alive):
    changes, told = CHECKPOINTS[what]
    path = foreign / "checkpoints" / "best.ckpt"
    content = torch.load(path, weights_only=True)
    content["hyper_parameters"] |= changes
    torch.save(content, path)
    for name in ("generate", "evaluate", "a study of a run"):
        with pytest.raises(CospeechError) as caught:
            ask(name, outputs, foreign, tmp_path / "made")
        assert str(path) in str(caught.value)
        assert told in str(caught.value)


def test_no_database_is_fitted_where_a_checkpoint_says(outputs):
    run = outputs.run("knn", below="fits")
    with command("generate"):
        model = open_run(run, "last").load()
        with pytest.raises(CospeechError, match="the prepared corpus is gone"):
            _ = model.database
        with pytest.raises(CospeechError, match="chunk_frames"):
            open_run(run, "last").load(chunk_frames=10**12)


def _load_with_huge_numbers(model: str, run: Path, told) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30,) * 2)
    path = run / "checkpoints" / "best.ckpt"
    content = torch.load(path, weights_only=True)
    sound = content["hyper_parameters"]
    for name, hint in get_type_hints(METHODS[model][0].__init__).items():
        if hint is not int:
            continue
        torch.save({**content, "hyper_parameters": {**sound, name: 10**9}}, path)
        try:
            with command("generate"):
                open_run(run).load()
            told.put((name, "loads"))
        except CospeechError as error:
            told.put((name, str(error)))
    told.put(None)


@pytest.mark.slow
@pytest.mark.parametrize("model", METHODS)
def test_no_number_in_a_checkpoint_takes_memory_without_end(model, outputs):
    context = multiprocessing.get_context("spawn")
    told = context.Queue()
    run = outputs.run(model, below=f"huge_{model}", stage=STAGES.get(model))
    child = context.Process(target=_load_with_huge_numbers, args=(model, run, told))
    child.start()
    found = dict(iter(lambda: told.get(timeout=300), None))
    child.join()
    assert len(found) > 2
    for name, message in found.items():
        assert "too large or too deep" not in message, name  # that was the limit of memory


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no checkpoint",
        {"state_dict": {}, "hyper_parameters": Bomb()},
        {"state_dict": {}, "hyper_parameters": {}},
        {"state_dict": {}},
        {"hyper_parameters": {}},
        {"state_dict": [], "hyper_parameters": []},
        [],
    ],
    ids=["empty", "text", "a class", "no settings", "none at all", "no weights", "lists", "a list"],
)
def test_a_damaged_checkpoint_is_named_with_what_to_do(content, outputs, foreign, tmp_path, alive):
    path = foreign / "checkpoints" / "best.ckpt"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        torch.save(content, path)
    for name in ("generate", "evaluate", "a study of a run"):
        with pytest.raises(CospeechError) as caught:
            ask(name, outputs, foreign, tmp_path / "made")
        assert str(path) in str(caught.value)
        assert "checkpoint=last takes last.ckpt" in str(caught.value)


def places(value, above=()):
    """Where something stands in JSON values: the way there, by keys and indices."""
    if above:
        yield above
    items = value.items() if isinstance(value, dict) else ()
    for key, inner in items:
        yield from places(inner, (*above, key))


WRONG = (None, True, -1, 1e300, "", "x" * 5000, "a\0b", [[]], {"a": {"b": 1}})


def test_values_of_another_type_anywhere_are_refused_or_of_no_account(
    outputs, foreign, monkeypatch
):
    monkeypatch.setattr(finished_run, "known_part", functools.cache(known_part))
    sound = read_record(foreign)
    refused = 0
    with command("generate"):
        for place in places(sound):
            for wrong in WRONG:
                record = json.loads(json.dumps(sound))
                inner = record
                for key in place[:-1]:
                    inner = inner[key]
                inner[place[-1]] = wrong
                write_record(foreign, record)
                try:
                    open_run(foreign).find_store([outputs.folder / "stores"])
                except CospeechError:
                    refused += 1
    assert refused > 100


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"id": "x", "status": "ok"}', "\udcff"])
def test_what_is_no_record_is_named(text, foreign):
    path = foreign / "record.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with command("generate"), pytest.raises(CospeechError, match=r"record\.json"):
        open_run(foreign)


@pytest.mark.parametrize(
    ("case", "name", "told"),
    [
        ("run_record_runs_a_command", "evaluate", "torch.utils.collect_env.run"),
        ("run_record_runs_a_command", "generate", "torch.utils.collect_env.run"),
        ("run_record_without_config", "evaluate", "has no model, data, ablation, seed, config"),
        ("run_record_without_config", "generate", "has no model, data, ablation, seed, config"),
        ("run_checkpoint_empty", "generate", "best.ckpt: is empty"),
    ],
)
def test_hostile_cases(case, name, told, outputs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CospeechError) as caught:
        ask(name, outputs, HOSTILE / case, tmp_path / "made")
    assert told in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("group", ["model", "data"])
def test_every_part_that_configs_offer_passes_the_door(group):
    yamls = {path.stem for path in (CONF / group).glob("*.yaml")} - {"base"}
    with command("evaluate"):
        assert names_of(group) == sorted(yamls)
        parts = [known_part(group, name) for name in sorted(yamls)]
        for stranger in ("../callbacks/default", "base", "", "nothing"):
            assert known_part(group, stranger) is None
    for part in parts:
        kind = get_class(part.target)
        if group == "data":  # which no record builds
            assert set(argument_names(kind)) == set(part.values), part.name
            continue
        plain = {
            key: value
            for key, value in part.values.items()
            if not (isinstance(value, str) and ("${" in value or value == "???"))
        }
        require_arguments(kind, plain, part.name)
        first = next(iter(plain))
        with pytest.raises(CospeechError, match=first):
            require_arguments(kind, {**plain, first: {"_target_": "os.system"}}, part.name)
