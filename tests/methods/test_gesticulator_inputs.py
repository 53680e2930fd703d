"""What Gesticulator hears and reads, and settings that can't be."""

import numpy as np
import pytest

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import ConfigError, InputFileError
from cospeech.methods.gesticulator import Gesticulator
from cospeech.methods.gesticulator.inputs import speech_inputs
from cospeech.speech.speech import Speech

SILENT = {
    "spectrogram": [-12.0] * 64,
    "mfcc": [np.log(np.finfo(float).eps), *[0.0] * 25],
    "prosody": [0.0] * 4,
}


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


def test_files_that_are_not_there_are_told_when_the_method_is_built():
    with pytest.raises(InputFileError, match=r"no\.vec"):
        Gesticulator(placeholder_facts(), text="static", word_vectors="no.vec")
    pytest.importorskip("transformers")
    with pytest.raises(InputFileError, match="no model that can be read"):
        Gesticulator(placeholder_facts(), language_model="/no/model")
