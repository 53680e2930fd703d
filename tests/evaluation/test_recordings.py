"""What is judged on, and what is too little for it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError
from cospeech.evaluation import (
    Catalogue,
    evaluate_recordings,
    reference_rows,
    standard_catalogue,
)
from cospeech.evaluation.real_windows import real_windows
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.moments import recording_moments
from cospeech.metrics.uncertainty import fgd_interval
from cospeech.metrics.window_metric import MeanOverWindows
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from tests.corpora import REST_POSE, make_recording, make_store

METRICS = standard_catalogue()


def untrained_encoder(store, seed):
    torch.manual_seed(seed)
    return MotionAutoencoder(store.facts()).encoder("untrained")


@pytest.mark.parametrize(
    ("seconds", "windows"),
    [(2.0, 0), (2.4, 1)],  # of 34 frames at 15 fps
)
def test_too_few_recordings_are_counted_and_what_to_do_is_said(tmp_path, seconds, windows):
    takes = [make_recording(f"take{i}", seconds=10, seed=i) for i in range(3)]
    store = make_store(tmp_path, [*takes, make_recording("last", seconds=seconds)])
    with pytest.raises(CospeechError) as caught:
        reference_rows(store, SimpleNamespace(sha256=64 * "0"), "test", seed=0, catalogue=METRICS)
    told = f"1 recordings to judge on, the longest of {seconds:.2f} s, hold {windows} evaluation"
    assert told in str(caught.value)
    assert "data.split=time_blocks" in str(caught.value)


def test_recordings_too_short_to_generate_for_are_refused_before_anything_is_made(tmp_path):
    takes = [make_recording(f"take{i}", seconds=10, seed=i) for i in range(3)]
    store = make_store(tmp_path, [*takes, make_recording("last", seconds=2)])
    with pytest.raises(CospeechError, match=r"1 recordings to judge on, the longest of 2\.00 s"):
        evaluate_recordings(None, store, "test", None, METRICS)


def test_reference_rows_are_kept_for_their_encoder_and_their_seed(tmp_path):
    store = make_store(tmp_path, [make_recording(f"take{i}", seconds=12, seed=i) for i in range(5)])
    one, other = untrained_encoder(store, 1), untrained_encoder(store, 2)
    rows = reference_rows(store, one, "test", seed=0, catalogue=METRICS)
    assert reference_rows(store, one, "test", seed=1, catalogue=METRICS) != rows
    assert reference_rows(store, other, "test", seed=0, catalogue=METRICS) != rows
    assert reference_rows(store, one, "val", seed=0, catalogue=METRICS) != rows
    assert reference_rows(store, one, "test", seed=0, catalogue=METRICS) == rows
    assert len(list((store.path / "references").iterdir())) == 4


class Still(torch.nn.Module):
    """Stands still, and notes how it was asked."""

    def __init__(self):
        super().__init__()
        self.asked = []

    def generate(self, speech, speaker, generator):
        self.asked.append((speaker, generator.initial_seed(), self.training))
        frames = math.ceil(speech.duration * 15)
        return Motion(UPPER_BODY, 15.0, REST_POSE[None].repeat(frames, axis=0))


def test_a_recording_is_generated_by_its_speaker_from_its_own_seed_without_dropout(tmp_path):
    store, method = make_store(tmp_path), Still()
    evaluate_recordings(method, store, "train", untrained_encoder(store, 0), METRICS)
    speakers = ("ada", "ben", "ada", "ben")
    assert method.asked == [(name, number, False) for number, name in enumerate(speakers)]
    assert method.training  # as it was before


def test_who_never_spoke_in_the_training_has_no_name(tmp_path):
    names = ("ada", "ada", "ada", "new")
    takes = [make_recording(f"take{i}", name, seed=i) for i, name in enumerate(names)]
    store, method = make_store(tmp_path, takes), Still()
    evaluate_recordings(method, store, "test", untrained_encoder(store, 0), METRICS)
    assert method.asked == [(None, 0, False)]


@pytest.mark.parametrize(
    ("seconds", "speakers", "expected"),
    [
        (2.4, ("ada", "ben", "ada"), ["ada", "ben", "ada"]),  # samples, cut from longer takes
        (2.4, ("ada", "ada", "ada"), ["take0", "take1", "take2"]),
        (3.0, ("ada", "ben", "ada"), ["take0", "take0", "take1", "take1", "take2", "take2"]),
    ],
)
def test_of_samples_of_one_window_the_speaker_is_what_is_independent(
    tmp_path, seconds, speakers, expected
):
    takes = [make_recording(f"take{i}", who, seconds) for i, who in enumerate(speakers)]
    others = [make_recording(name, "ada", seconds) for name in ("v", "t")]
    store = make_store(tmp_path, [*takes, *others])
    assert real_windows(store, store.splits["train"])[1] == expected


class Labelled(MeanOverWindows):
    """The share of frames that somebody annotated."""

    title = "labelled"
    needs = frozenset({"phases"})
    compares = "nothing"
    higher_is_better = None

    def mean(self, generated, real):
        return (generated.fields["phases"] >= 0).double().mean()


def test_recordings_and_training_windows_without_what_a_metric_reads_are_left_out(tmp_path):
    seconds = (8, 7, 9, 10)
    takes = [
        make_recording(f"take{i}", seconds=s, seed=i, phases=i in (1, 3))
        for i, s in enumerate((*seconds, 8, 8))
    ]
    takes[5] = make_recording("take5", seconds=8, seed=5, phases=True)
    store = make_store(tmp_path, takes)
    windows = [(15 * s - 34) // 10 + 1 for s in seconds]
    encoder, catalogue = untrained_encoder(store, 0), Catalogue({"labelled": Labelled()})
    row = evaluate_recordings(Still(), store, "train", encoder, catalogue)
    assert (row["windows"], row["labelled"]) == (windows[1] + windows[3], 1)
    first = evaluate_recordings(Still(), store, "train", encoder, catalogue, limit=1)
    assert (first["windows"], first["labelled"]) == (windows[1], 1)
    rows = reference_rows(store, encoder, "test", 0, catalogue)
    assert (rows["real_train"]["windows"], rows["real_train"]["labelled"]) == (
        windows[1] + windows[3],
        1,
    )


class Waving:
    """Motion of its own for every recording, by its length."""

    training = True

    def eval(self):
        return self

    def train(self, mode):
        return self

    def generate(self, speech, speaker, generator):
        frames = math.ceil(speech.duration * 15)
        motion = REST_POSE[None].repeat(frames, axis=0)
        motion[:, 4:] += 0.3 * np.sin(np.arange(frames) * frames / 500)[:, None, None]
        return Motion(UPPER_BODY, 15.0, motion)


def test_the_interval_draws_whole_recordings(tmp_path):
    seconds = (7, 16, 9, 12)
    takes = [make_recording(f"take{i}", seconds=s, seed=i) for i, s in enumerate((*seconds, 8, 8))]
    store = make_store(tmp_path, takes)
    encoder = MotionAutoencoder(store.facts()).encoder("untrained")
    row = evaluate_recordings(Waving(), store, "train", encoder, standard_catalogue())

    made, real = [], []
    for i, length in enumerate(seconds):
        speech = SimpleNamespace(duration=length)
        recorded = store.upper_body_motion(store.splits["train"][i])
        for motions, motion in ((made, Waving().generate(speech, None, None)), (real, recorded)):
            windows = [
                motion.positions[first : first + 34] for first in range(0, 15 * length - 33, 10)
            ]
            motions.append(encoder.encode_all(torch.from_numpy(np.stack(windows)).float()))
    ids = [i for i, of_one in enumerate(real) for _ in of_one]
    expected = fgd_interval(
        recording_moments(torch.cat(real), ids), recording_moments(torch.cat(made), ids)
    )
    assert (row["fgd_low"], row["fgd_high"]) == pytest.approx(
        (expected.low, expected.high), rel=1e-4
    )

    def judged(features):
        return EvaluationWindows(torch.zeros(len(features), 34, 10, 3), features)

    pair = judged(torch.cat(made)), judged(torch.cat(real))
    row = standard_catalogue().row(*pair, recording_ids=ids, seed=3)
    moments = (recording_moments(windows.features, ids) for windows in reversed(pair))
    assert row["fgd_low"] == fgd_interval(*moments, seed=3).low != expected.low
