"""What Gesticulator hears and reads, and settings that can't be."""

import numpy as np
import pytest
from lightning import Trainer

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.experiment.finished_run import load
from cospeech.methods.gesticulator import Gesticulator
from cospeech.methods.gesticulator import inputs as gesticulator_inputs
from cospeech.methods.gesticulator.inputs import speech_inputs
from cospeech.speech.speech import Speech
from cospeech.speech.text import contextual
from tests.runs import METHODS, Outputs

SILENT = {
    "spectrogram": [-12.0] * 64,
    "mfcc": [np.log(np.finfo(float).eps), *[0.0] * 25],
    "prosody": [0.0] * 4,
}


@pytest.fixture(autouse=True)
def without_the_extra(monkeypatch):
    """No vector is asked for here, so it needn't be installed."""
    monkeypatch.setattr(gesticulator_inputs, "require_extra", lambda: None)


def test_without_the_extra_it_is_told_when_the_method_is_built(monkeypatch):
    monkeypatch.setattr(contextual, "find_spec", lambda name: None)
    monkeypatch.setattr(gesticulator_inputs, "require_extra", contextual.require_extra)
    with pytest.raises(CospeechError, match="need the extra 'text'"):
        Gesticulator(placeholder_facts())
    Gesticulator(placeholder_facts(), text="none")


@pytest.mark.parametrize(
    "audio", ["spectrogram", "mfcc", "prosody", "mfcc_prosody", "spectrogram_prosody"]
)
def test_a_frame_is_sound_then_text_each_with_its_silence(audio):
    kinds = audio.split("_")
    inputs = speech_inputs(audio, "none")
    silent = [value for kind in kinds for value in SILENT[kind]]
    np.testing.assert_allclose(inputs.silence, silent, atol=1e-4)
    assert [field.width for field in inputs.fields] == [len(SILENT[kind]) for kind in kinds]
    # 384 numbers of a vector and five of timing
    both = speech_inputs(audio, "contextual")
    np.testing.assert_array_equal(both.silence, [*inputs.silence, *[-15.0] * 384, *[0.0] * 5])
    assert [field.name for field in both.fields][-1] == "spoken_words"


@pytest.mark.parametrize("audio", ["mfcc", "prosody"])
def test_the_silence_of_cepstra_and_prosody_is_the_fields_own(audio):
    inputs = speech_inputs(audio, "none")
    quiet = Speech(np.zeros(16_000, dtype=np.float32))
    for row in inputs.fields[0].of_speech(quiet, 20.0):
        np.testing.assert_array_equal(row, inputs.silence)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"audio": "loud"}, "model.audio='loud' is not one of spectrogram, mfcc, prosody, mfcc_"),
        ({"text": "sung"}, "model.text='sung' is not one of contextual, static, none"),
        ({"audio": "none", "text": "none"}, "nothing to gesture to"),
        ({"text": "static"}, "name a fastText file: model.word_vectors=FILE"),
        ({"pca": 0}, "model.pca=0: must be from 1 to 45"),
        ({"pca": 50}, "model.pca=50: must be from 1 to 45"),
        ({"pca": 0.95}, "model.pca=0.95 is no number of components"),
        ({"schedule": "mine"}, "model.schedule='mine'"),
        ({"conditioning": "lstm"}, "model.conditioning='lstm'"),
        ({"velocity_axis": "joints"}, "model.velocity_axis='joints'"),
        ({"velocity_weight": -1}, "model.velocity_weight=-1: must be at least 0"),
        ({"dropout": 1.5}, "model.dropout=1.5: must be from 0 to 1"),
        ({"conditioning_dropout": -0.1}, "model.conditioning_dropout=-0.1"),
    ],
)
def test_a_setting_that_can_not_be_is_told_when_the_method_is_built(settings, message):
    with pytest.raises(ConfigError, match=message):
        Gesticulator(placeholder_facts(), **settings)


@pytest.mark.parametrize("model", [None, "a/model"])
def test_special_tokens_are_part_of_what_features_are_kept_under(monkeypatch, model):
    class Named:
        dimensions = 8

        def __init__(self, name, special_tokens):
            self.version = f"{name}, {special_tokens}"

    monkeypatch.setattr(gesticulator_inputs, "ContextualVectors", Named)
    told, bare = (
        speech_inputs("none", "contextual", model, special_tokens=given) for given in (True, False)
    )
    assert told.text_version != bare.text_version
    assert told.fields[-1].version != bare.fields[-1].version
    versions = ("minilm", "minilm-bare") if model is None else ("a/model, True", "a/model, False")
    assert (told.text_version, bare.text_version) == versions


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A finished run with static vectors, of whose file nobody has taken care since."""
    monkeypatch.setitem(METHODS, "gesticulator", (Gesticulator, {"text": "static"}))
    outputs = Outputs(tmp_path / "outputs")
    outputs.facts = placeholder_facts()
    file = tmp_path / "m.vec"
    file.write_text("2 3\nhello 1 2 3\nworld 4 5 6\n")
    monkeypatch.setitem(METHODS["gesticulator"][1], "word_vectors", str(file))
    return outputs.run("gesticulator"), file


def refusal(run, **given):
    with pytest.raises(InputFileError) as caught:
        load(run, "last", **given)
    assert caught.value.hint.count("\n") == caught.value.problem.count("\n") == 0
    return caught.value


def test_a_finished_run_speaks_with_the_word_vectors_that_it_learned_from(run):
    run, file = run
    known = load(run).text_version
    moved = file.rename(file.with_name("moved.vec"))
    gone = refusal(run)
    assert gone.problem == f"{file}: the file of word vectors is gone, or was never there"
    assert "put it back, or say where it lies now: cospeech.load(RUN, word_vectors=" in gone.hint
    assert load(run, word_vectors=str(moved)).text_version == known
    # Of the same size, and of another dimension, whose weights would have other sizes, too.
    for content in ("2 3\nhello 1 2 3\nworld 4 5 7\n", "2 2\nhello 1 2\nworld 4 5\n"):
        file.write_text(content)
        other = refusal(run)
        assert other.problem.startswith(f"{file}: isn't the same any more: text has other vectors")
        assert "word_vectors=PATH" in other.hint
    assert refusal(run, text="contextual").hint.endswith("language_model=PATH)")


def test_a_checkpoint_is_not_loaded_with_other_word_vectors(run, tmp_path):
    run, file = run
    trainer, path = Trainer(accelerator="cpu", logger=False), tmp_path / "model.ckpt"
    trainer.strategy.connect(load(run))
    trainer.save_checkpoint(path)
    assert Gesticulator.load_from_checkpoint(path, weights_only=True).text_version
    file.write_text("1 3\nhello 1 2 4\n")
    with pytest.raises(InputFileError, match="isn't the same any more"):
        Gesticulator.load_from_checkpoint(path, weights_only=True)


def test_files_that_are_not_there_are_told_when_the_method_is_built():
    with pytest.raises(InputFileError, match=r"no\.vec: the file of word vectors is gone"):
        Gesticulator(placeholder_facts(), text="static", word_vectors="no.vec")
    pytest.importorskip("transformers")
    with pytest.raises(InputFileError, match=r"^/no/model: no model that can be read") as caught:
        Gesticulator(placeholder_facts(), language_model="/no/model")
    assert "cospeech.load(RUN, language_model=PATH)" in caught.value.hint
