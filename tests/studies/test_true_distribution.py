"""Motion drawn anew for the embedded corpus, and systems scored against it."""

import json
from itertools import islice

import numpy as np
import pytest
import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import GENERATOR_VERSION, synthesise
from cospeech.corpus.synthetic.rerolls import rerolls
from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.tts import speak_all
from cospeech.studies.trained_system import TrainedSystem
from cospeech.studies.true_distribution import true_distribution
from tests.corpora import make_store

MINUTES, SEED, SPEAKERS = 4, 5, 2


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    settings = {
        "generator": GENERATOR_VERSION,
        "minutes": MINUTES,
        "seed": SEED,
        "speakers": SPEAKERS,
    }
    folder = tmp_path_factory.mktemp("s") / "s"
    with StoreWriter(folder, "small", {"settings": settings}, "0" * 64) as writer:
        for recording in synthesise(MINUTES, SEED, SPEAKERS, fps=15):
            writer.add(recording)
        frames = writer.columns()["frames"]
        count = len(frames)
        train = [Span(i, 0, frames[i]) for i in range(count - 6)]
        test = [Span(i, 0, frames[i]) for i in range(count - 6, count)]
        return writer.finish({"train": train, "val": test[:1], "test": test})


def test_motions_are_drawn_anew_each_by_itself(store):
    recordings = [0, 3]
    drawn = dict(rerolls(store, recordings, 2))
    assert list(drawn) == recordings
    for index, motions in drawn.items():
        recorded = store.upper_body(index)
        assert motions.shape == (2, *recorded.shape)
        for one, other in ((motions[0], motions[1]), *((each, recorded) for each in motions)):
            assert np.abs(one - other).mean() > 0.005


def test_speech_that_is_spoken_otherwise_is_noticed(store, monkeypatch):
    """The voice carries state: without the first line, the others sound a little different."""

    def without_the_first(lines):
        yield from speak_all(lines[:1])
        yield from speak_all(lines[1:])

    monkeypatch.setattr("cospeech.corpus.synthetic.rerolls.speak_all", without_the_first)
    with pytest.raises(CospeechError, match="the voice here doesn't speak it as it was spoken"):
        dict(rerolls(store, range(len(store.recordings)), 1))


@pytest.mark.parametrize(
    "change",
    [
        {"minutes": 1e12},
        {"minutes": -1},
        {"minutes": "4"},
        {"speakers": 10**9},
        {"seed": 0.5},
        {"generator": "0"},
    ],
)
def test_what_a_strange_store_says_of_its_making_is_refused(store, monkeypatch, change):
    settings = store.manifest["parameters"]["settings"] | change
    monkeypatch.setitem(store.manifest["parameters"], "settings", settings)
    with pytest.raises(CospeechError, match="for the embedded corpus alone"):
        next(rerolls(store, [0], 1))


def test_of_another_corpus_nothing_can_be_drawn(store, tmp_path):
    with pytest.raises(CospeechError, match="made: motion can be drawn anew for the embedded"):
        next(rerolls(make_store(tmp_path), [0], 1))


class Drawing(torch.nn.Module):
    """Draws from the true distribution, by the seed that it is given."""

    def __init__(self, store):
        super().__init__()
        made = dict(rerolls(store, [span.recording for span in store.splits["test"]], 14))
        self.motions = [motions[9:] for motions in made.values()]

    def generate(self, speech, speaker, generator):
        sample, stretch = divmod(generator.initial_seed(), 1000)
        return Motion(UPPER_BODY, 15.0, self.motions[stretch][sample])


class First(Drawing):
    """Makes one of its motions again and again."""

    def generate(self, speech, speaker, generator):
        motions = self.motions[generator.initial_seed() % 1000]
        return Motion(UPPER_BODY, 15.0, motions[0])


def test_what_draws_from_the_truth_is_at_zero_and_what_knows_less_is_above(store, tmp_path, capsys):
    drawing, first = Drawing(store), First(store)
    systems = [TrainedSystem("true", 0, drawing), TrainedSystem("true", 1, drawing)]
    found = true_distribution(
        store, "test", tmp_path, [*systems, TrainedSystem("one", 0, first)], seed=0
    )
    assert json.loads((tmp_path / "true_distribution.json").read_text()) == json.loads(
        json.dumps(found)
    )
    rows = found["systems"]
    assert list(islice(rows, 5)) == [
        "oracle",
        "same speaker, other speech",
        "another speaker",
        "mean pose of the speaker",
        "mean pose",
    ]
    score = {name: row["energy_score_cm"] for name, row in rows.items()}
    for name in ("oracle", "true"):
        assert rows[name]["samples"] == 5
        assert abs(score[name]) < 0.3
        low, high = rows[name]["interval"]
        assert low < 0 < high or abs(score[name]) < 0.15
    assert score["another speaker"] > score["same speaker, other speech"] + 0.1 > 0.2
    assert score["mean pose"] > score["mean pose of the speaker"] > 1.2
    assert rows["one"]["samples"] == 1
    assert score["one"] > 2
    assert rows["true"]["seeds"] == [0, 1]
    same = rows["same speaker, other speech"]
    assert same["over_same_speaker_cm"] == 0
    assert rows["oracle"]["over_same_speaker_cm"] == pytest.approx(
        score["oracle"] - score["same speaker, other speech"]
    )
    printed = capsys.readouterr().out
    assert "energy score, cm ↓" in printed
    assert "test: 6 recordings of small." in printed


def test_of_one_speaker_nobody_else_has_a_row(store, tmp_path, monkeypatch):
    columns = store.recordings.columns
    monkeypatch.setitem(columns, "speaker", ["one"] * len(columns["id"]))
    rows = true_distribution(store, "test", tmp_path, [], seed=0)["systems"]
    assert "same speaker, other speech" in rows
    assert "another speaker" not in rows


def test_the_training_part_is_refused(store, tmp_path):
    with pytest.raises(CospeechError, match="have seen the training part"):
        true_distribution(store, "train", tmp_path, [], seed=0)
