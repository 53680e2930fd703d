"""What is typed behind a command: read, quoted, checked, and explained in one line."""

import shlex
from pathlib import Path

import pytest

from cospeech.errors import ConfigError
from cospeech.experiment import typed
from cospeech.experiment.help import help_text
from cospeech.experiment.typed import Command, check_typed, read_overrides
from cospeech.quoting import setting

CONF = Path(__file__).resolve().parents[2] / "conf"
TRAIN, GENERATE = Command("train", CONF), Command("generate", CONF)
EVALUATE = Command("evaluate", CONF)


class Loud:
    """In the place of a user's metric."""

    def __init__(self, threshold=1):
        self.threshold = threshold


def refused(*overrides: str, command: Command = TRAIN, multirun: bool = False) -> ConfigError:
    with pytest.raises(ConfigError) as error:
        check_typed(command, list(overrides), multirun)
    return error.value


@pytest.mark.parametrize(
    ("typed", "problem"),
    [
        (["modl=trimodal"], "modl: there is no such setting; did you mean 'model'?"),
        (["model=trimodl"], "model=trimodl: there is no such model; did you mean 'trimodal'?"),
        (["model=trimodal", "data=ned"], "data=ned: there is no such data; did you mean 'ted'?"),
        (
            ["model=trimodal", "model.hiden_size=3"],
            "model.hiden_size: there is no such setting; did you mean 'hidden_size'?",
        ),
        (
            ["model=trimodal", "trainer.max_epoch=3"],
            "trainer.max_epoch: there is no such setting; did you mean 'max_epochs'?",
        ),
        (
            ["model=trimodal", "data=mocap", "data.rot=x"],
            "data.rot: there is no such setting; did you mean 'root'?",
        ),
        (
            ["model=trimodal", "hidden_size=3"],
            "hidden_size: there is no such setting; did you mean 'model.hidden_size'?",
        ),
        (["model=knn", "+sede=3"], "sede: there is no such setting; did you mean 'seed'?"),
        (["model=knn", "++sede=3"], "sede: there is no such setting; did you mean 'seed'?"),
        (
            ["model=knn", "+training.ephocs=3"],
            "training.ephocs: there is no such setting; did you mean 'epochs'?",
        ),
        (["model=knn", "~data.mintes"], "did you mean 'minutes'?"),
        (
            ["model=knn", "ablation=trimodal__no_audio"],
            "ablation=trimodal__no_audio is not of model=knn, which has no context",
        ),
        (["model=knn", "experiment=trimodal_quick"], "is not of model=knn"),
        (["model=knn", "seed=1,2"], "seed=1,2: several values, and this is one run"),
        (["model=knn", "trimodal"], "trimodal: settings are written name=value"),
        ([], "model is not set"),
    ],
)
def test_a_slip_is_one_line_with_the_nearest_name(typed, problem):
    error = refused(*typed)
    assert problem in error.problem
    assert "\n" not in error.problem
    assert error.hint


def test_without_a_model_the_models_are_listed():
    assert "trimodal" in str(refused().hint)
    assert "motion_autoencoder" in str(refused().hint)


def test_the_ablations_of_the_model_are_listed():
    hint = str(refused("model=knn", "ablation=trimodal__no_audio").hint)
    assert "knn__crossfade" in hint
    assert "trimodal" not in hint


def test_an_unknown_addition_of_another_command_is_refused():
    assert "export: there is no such setting" in refused("+export=bvh", command=GENERATE).problem


def test_an_argument_of_an_object_may_be_added_and_no_other():
    check_typed(TRAIN, ["model=knn", "+trainer.fast_dev_run=true"], False)
    assert "did you mean 'fast_dev_run'" in refused("model=knn", "+trainer.fast_dev_runn=1").problem
    error = refused("model=knn", "trainer.fast_dev_run=true")
    assert "+trainer.fast_dev_run=true" in str(error.hint)


def test_a_setting_that_no_corpus_has_is_named_without_importing_one(monkeypatch):
    monkeypatch.setattr(typed, "known_arguments", lambda target: pytest.fail(f"imports {target}"))
    error = refused("model=knn", "data.bogus=1")
    assert error.problem == "data.bogus: there is no such setting"
    assert str(error.hint).startswith("data knows: batch_size, corpus_seed, encoder, max_record")


def test_a_callback_may_be_added_if_it_says_what_it_is():
    stop = "lightning.pytorch.callbacks.EarlyStopping"
    added = ["+callbacks.stop._target_=" + stop, "+callbacks.stop.monitor=val/fgd"]
    check_typed(TRAIN, ["model=trimodal", *added], False)
    error = refused("model=trimodal", added[0], "+callbacks.stop.montor=val/fgd")
    assert "callbacks.stop.montor: EarlyStopping has no such setting" in error.problem
    assert "nonsense" in refused("model=knn", "+callbacks.x._target_=nonsense.X").problem
    assert "callbacks.x" in refused("model=knn", "+callbacks.x=3").problem


def test_a_metric_may_be_added_if_it_says_what_it_is():
    target = f"{__name__}.Loud"
    added = f"+metrics.catalogue.x._target_={target}"
    check_typed(TRAIN, ["model=trimodal", added, "+metrics.catalogue.x.threshold=3"], False)
    check_typed(EVALUATE, [f"+metrics.catalogue.x={{_target_: {target}}}"], False)
    for given, problem in (
        ([added, "+metrics.catalogue.x.treshold=3"], "no such setting; did you mean 'threshold'?"),
        (["+metrics.catalogue.fgd.threshold=3"], "FrechetGestureDistance has no such setting"),
        (["+metrics.catalogue.x=3"], "metrics.catalogue.x: there is no such setting"),
        ([added[1:]], "metrics.catalogue.x: not in metrics.catalogue"),
    ):
        error = refused(*given, command=EVALUATE)
        assert problem in error.problem
    assert error.hint == f"one more is added with +: {added}"
    # No yaml says of which type this is.
    check_typed(EVALUATE, ["+metrics.catalogue={x: 3}"], False)


@pytest.mark.parametrize(
    ("typed", "problem"),
    [
        ("model.hidden_size=many", "model.hidden_size: wants a whole number, not 'many'"),
        ("model.dropout=[1]", "model.dropout: wants a number, not a list or a mapping"),
        ("model.mean_style=3", "model.mean_style: wants true or false, not 3"),
    ],
)
def test_a_value_of_another_type_is_named_before_anything_is_made(typed, problem):
    assert problem in refused("model=trimodal", typed).problem


@pytest.mark.parametrize(
    ("typed", "problem"),
    [
        ("seed=-1", "seed=-1: a whole number of at least 0 is wanted"),
        ("seed=abc", "seed: wants a whole number, not 'abc'"),
        ("seed=null", "seed: wants a whole number, not null"),
        ("test=perhaps", "test: wants true or false, not 'perhaps'"),
        ("ckpt_path=3", "ckpt_path: wants a text, not 3"),
        ("outputs_dir=", "outputs_dir is empty"),
        ("metrics.encoder=", "metrics.encoder is empty"),
        ("metrics.encoder=null", "metrics.encoder: wants a text, not null"),
        ("metrics.encoder_epochs=0", "metrics.encoder_epochs=0: a whole number of at least 1"),
        ("training.epochs=1.5", "training.epochs: wants a whole number, not 1.5"),
        ("training.epochs=-2", "training.epochs=-2: a whole number of at least -1 is wanted"),
        ("training.epochs=[1]", "training.epochs: wants a whole number, not a list"),
        ("training.batch_size=0", "training.batch_size=0: a whole number of at least 1"),
        ("training.batch_size=1.5", "training.batch_size: wants a whole number, not 1.5"),
        ("data.batch_size=0", "data.batch_size=0: a whole number of at least 1"),
        ("model.hidden_size=-4", "model.hidden_size=-4: a whole number of at least 1"),
        ("model.hidden_size=8.0", "model.hidden_size: wants a whole number, not 8.0"),
        ("model.adversarial_start_epoch=-1", "at least 0"),
    ],
)
def test_a_value_that_nothing_can_be_made_of_is_named_at_once(typed, problem):
    assert problem in refused("model=trimodal", typed).problem


def test_values_of_other_commands_are_checked_too():
    assert "seed: wants a whole number" in refused("seed=abc", command=GENERATE).problem
    assert "audio: wants a text" in refused("audio=7", command=GENERATE).problem
    assert "speaker: wants a text" in refused("speaker=7", command=GENERATE).problem
    check_typed(GENERATE, ["run=a", "audio=b.wav", "speaker=null", 'transcript="7"'], False)


@pytest.mark.parametrize("model", ["motion_autoencoder", "knn_cgan"])
def test_epochs_without_end_and_the_yamls_own_values_pass(model):
    check_typed(TRAIN, [f"model={model}", "training.epochs=-1"], False)
    check_typed(TRAIN, [f"model={model}", "debug=fast", "seed=3"], False)
    assert "wants a whole" in refused(f"model={model}", "training.epochs=a").problem


def test_a_folder_named_like_a_number_gets_its_quotes():
    error = refused("model=trimodal", "data=mocap", "data.root=123")
    assert """'data.root="123"'""" in str(error.hint)
    check_typed(TRAIN, ["model=trimodal", "data=mocap", 'data.root="123"'], False)


def test_every_value_of_a_sweep_is_checked():
    check_typed(TRAIN, ["model=trimodal", "ablation=full,trimodal__no_audio", "seed=0,1"], True)
    assert (
        "is not of model=knn"
        in refused("model=knn,trimodal", "ablation=full,trimodal__no_audio", multirun=True).problem
    )
    assert (
        "wants a whole number"
        in refused("model=trimodal", "model.hidden_size=8,many", multirun=True).problem
    )


@pytest.mark.parametrize("typed", ["run=a", "runs=a", "runs=[a,b]"])
def test_runs_of_a_study_are_a_folder_or_several(typed):
    check_typed(EVALUATE, ["study=caused_gestures", typed], False)


@pytest.mark.slow
def test_a_study_brings_its_sweep():
    check_typed(TRAIN, ["study=knn_options"], False)
    error = refused("study=trimodal_ablations", "experiment=knn_cgan_quick")
    assert "is not of model=trimodal" in error.problem
    error = refused("study=trimodal_ablations", command=Command("evaluate", CONF))
    assert "not for evaluate.py" in error.problem


# Quoting ---------------------------------------------------------------------------------------

REFUSED_UNQUOTED = ["=", ",", "[x]", "(1)", "{", "}", "ä", "é", "東", "🎉", "'", '"', "#", "!", "&"]


@pytest.mark.parametrize("letter", REFUSED_UNQUOTED)
def test_a_path_that_hydra_refuses_gets_its_own_quoting(letter):
    path = f"/my/di{letter}r/x"
    error = refused("model=trimodal", "data=mocap", f"data.root={path}")
    assert setting("data.root", path) in str(error.hint)
    read_overrides(shlex.split(setting("data.root", path)))


# Help ------------------------------------------------------------------------------------------


def test_help_names_groups_choices_and_examples_before_a_model_is_chosen():
    text = help_text(TRAIN, [])
    assert "python train.py model=NAME" in text
    for name in ("trimodal", "mocap", "trimodal__no_audio", "tensorboard", "--multirun"):
        assert name in text
    assert max(len(line) for line in text.splitlines()) <= 110


def test_help_shows_the_settings_of_what_is_chosen():
    assert "hidden_size: 300" in help_text(TRAIN, ["model=trimodal"])
    assert "transcript:" in help_text(GENERATE, [])
