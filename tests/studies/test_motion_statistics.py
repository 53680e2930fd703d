"""The motion statistics of a run whose motion is known, and their picture."""

import json
import math

import numpy as np
import pytest
import torch
from matplotlib.image import imread

from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import MOVING_JOINTS, UPPER_BODY, to_upper_body
from cospeech.reporting.charts import colour
from cospeech.studies.motion_statistics import (
    BINS,
    SystemStatistics,
    measure_motion,
    motion_statistics,
    plot_motion_statistics,
)
from cospeech.studies.trained_system import TrainedSystem
from tests.corpora import REST_POSE, make_store
from tests.fabricated.mocap import body, swinging

RIGHT = UPPER_BODY.index["right_wrist"]


class Sliding(torch.nn.Module):
    """Slides to the side at 0.9 m/s, its right wrist by another 9 m/s, at 30 fps."""

    def generate(self, speech, speaker, generator):
        seconds = np.arange(math.ceil(speech.duration * 30)) / 30
        motion = REST_POSE[None].repeat(len(seconds), axis=0)
        motion[:, 1:, 0] += 0.9 * seconds[:, None]
        motion[:, RIGHT, 0] += 9 * seconds
        return Motion(UPPER_BODY, 30.0, motion)


class Still(torch.nn.Module):
    def generate(self, speech, speaker, generator):
        return Motion(UPPER_BODY, 15.0, REST_POSE[None].repeat(150, axis=0))


class Whole(torch.nn.Module):
    """Swings all joints of a whole skeleton, at 20 fps."""

    def generate(self, speech, speaker, generator):
        return swinging(body(), "whole", speech.duration, 20.0)


class TenOf(Whole):
    def generate(self, speech, speaker, generator):
        return to_upper_body(super().generate(speech, speaker, generator))


def test_of_a_whole_skeleton_the_ten_joints_are_measured(tmp_path):
    systems = [TrainedSystem("whole", 0, Whole()), TrainedSystem("ten", 0, TenOf())]
    found = motion_statistics(make_store(tmp_path), systems, "train", tmp_path)["systems"]
    assert found["whole"] == found["ten"]
    assert min(found["ten"]["per_recording"]["speed"]) > 0


def test_runs_of_one_name_are_one_system(tmp_path, capsys):
    store = make_store(tmp_path)
    systems = [TrainedSystem("full", 0, Sliding()), TrainedSystem("full", 1, Still())]
    found = motion_statistics(store, systems, "train", tmp_path)["systems"]
    assert list(found) == ["recorded", "full"]
    speeds = found["full"]["per_recording"]["speed"]
    np.testing.assert_allclose(speeds, 4 * [1.9] + 4 * [0], rtol=1e-4)
    assert len(found["full"]["per_recording"]["rmse"]) == 8
    assert len(found["recorded"]["per_recording"]["speed"]) == 4
    np.testing.assert_allclose(found["full"]["by_seed"]["speed"], [1.9, 0], rtol=1e-4)
    # half the difference of two values, times Student's 12.706 of one degree of freedom
    table = capsys.readouterr().out.split("95 % of the mean over seeds")[1]
    (row,) = [line for line in table.splitlines() if line.startswith("full")]
    assert row.split()[1:6] == ["2", "0.95", "(-11.1", "to", "13)"]
    assert "recorded  " not in table


def test_a_run_beside_what_was_recorded(tmp_path, capsys):
    store = make_store(tmp_path)
    systems = [TrainedSystem("no_text", 0, Still()), TrainedSystem("full", 0, Sliding())]
    found = motion_statistics(store, systems, "train", tmp_path, about=[("runs", "r")])
    assert json.loads((tmp_path / "motion_statistics.json").read_text()) == found
    assert found["runs"] == "r"
    assert list(found["systems"]) == ["recorded", "full", "no_text"]
    assert set(found["systems"]["no_text"]["per_recording"]["acceleration"]) == {0}
    made, real = (found["systems"][name] for name in ("full", "recorded"))
    assert len(made["per_recording"]["speed"]) == 4
    # nine joints at 0.9, and one of them at another 9
    np.testing.assert_allclose(made["per_recording"]["speed"], 1.9, rtol=1e-4)
    np.testing.assert_allclose(made["per_recording"]["speed_per_frame"], 190 / 15, rtol=1e-4)
    np.testing.assert_allclose(made["per_recording"]["jerk"], 0, atol=0.1)
    # both wrists at each of 149 steps: one in the bin from 0.9 on, or below by rounding; one beyond
    counts = made["histograms"]["speed"]
    assert counts[-1] == sum(counts[17:19]) == 4 * 149
    assert sum(counts) == 2 * 4 * 149
    assert sum(made["histograms"]["acceleration"]) == 2 * 4 * 148
    for span, speed, rmse in zip(
        store.splits["train"],
        real["per_recording"]["speed"],
        made["per_recording"]["rmse"],
        strict=True,
    ):
        recorded = store.upper_body_motion(span).positions[:, 1:].astype(float)
        steps = np.linalg.norm(np.diff(recorded, axis=0), axis=-1)
        assert speed == pytest.approx(15 * steps.mean(), rel=1e-6)
        motion = Sliding().generate(store.speech(span), None, None).positions[::2, 1:]
        squares = np.square(motion - recorded).sum(-1)
        assert rmse == pytest.approx(100 * np.sqrt(squares.mean()), rel=1e-5)
    assert "rmse" not in real["per_recording"]
    printed = capsys.readouterr().out
    assert "speed, m/s" in printed
    assert "jerk, cm/frame³" in printed
    assert "1.9" in printed
    assert "over seeds" not in printed


def test_both_conventions_differ_by_the_rate_and_the_unit():
    rng = np.random.default_rng(0)
    system = measure_motion([rng.normal(size=(20, len(MOVING_JOINTS), 3))])
    for name, order in (("speed", 1), ("acceleration", 2), ("jerk", 3)):
        (per_second,), (per_frame,) = (
            system.per_recording[key] for key in (name, f"{name}_per_frame")
        )
        assert per_frame == pytest.approx(100 * per_second / 15**order)


def test_what_is_beyond_the_last_bin_is_drawn(tmp_path):
    def ink(beyond):
        counts = np.full(BINS + 1, 10)
        counts[-1] = beyond
        system = SystemStatistics({}, {"speed": counts, "acceleration": counts})
        path = tmp_path / f"{beyond}.png"
        plot_motion_statistics({"recorded": system}, "corpus", path)
        pixels = np.round(255 * imread(path)[..., :3]).astype(int)
        rgb = [int(colour("c0")[i : i + 2], 16) for i in (1, 3, 5)]
        return (np.abs(pixels - rgb).max(-1) <= 5).mean()

    assert ink(400) > 2 * ink(0)
