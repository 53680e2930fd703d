"""The synchrony study on a small embedded corpus, with systems whose synchrony is known."""

import json

import numpy as np
import pytest
import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import synthesise
from cospeech.errors import CospeechError
from cospeech.metrics.beat_consistency import (
    BeatClip,
    MotionBeats,
    StressedSyllables,
    beat_consistency,
)
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.encoder.network import PoseAutoencoder
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.studies.synchrony import synchrony
from cospeech.studies.synchrony.rows import (
    LAGS_S,
    Detectors,
    how_it_moves,
    lag_of,
    mismatched_clips,
)

DETECTORS = Detectors(MotionBeats(), StressedSyllables())
WRISTS = [UPPER_BODY.index["left_wrist"], UPPER_BODY.index["right_wrist"]]


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with StoreWriter(tmp_path_factory.mktemp("s") / "s", "small", {}, "0" * 64) as writer:
        for recording in synthesise(4, seed=5, speakers=4, fps=15):
            writer.add(recording)
        frames = writer.columns()["frames"]
        half = len(frames) // 2
        return writer.finish(
            {
                "train": [Span(i, 0, frames[i]) for i in range(half)],
                "val": [Span(0, 0, frames[0])],
                "test": [Span(i, 0, frames[i]) for i in range(half, len(frames))],
            }
        )


@pytest.fixture(scope="module")
def encoder():
    torch.manual_seed(0)
    return GestureEncoder(PoseAutoencoder(), [0.0] * 27)


def on_syllables(speech, speaker="ada"):
    """Wrists that swing so that they turn at each stressed syllable and nowhere else."""
    times = np.arange(int(np.ceil(speech.duration * 15 - 1e-6))) / 15
    beats = DETECTORS.audio(speech.waveform, 16000)
    turns = np.concatenate([[beats[0] - 0.6], beats, [beats[-1] + 0.6]])
    phase = np.interp(times, turns, np.arange(len(turns)))
    positions = np.zeros((len(times), 10, 3), np.float32)
    positions[:, WRISTS, 1] = 0.2 * np.cos(np.pi * phase)[:, None]
    return Motion(UPPER_BODY, 15.0, positions)


def frozen(speech, speaker):
    return Motion(UPPER_BODY, 15.0, np.zeros_like(on_syllables(speech, speaker).positions))


@pytest.fixture(scope="module")
def result(store, encoder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out") / "study"
    systems = {"on syllables": on_syllables, "frozen": frozen}
    found = synchrony(
        store, encoder, "test", folder, systems, seed=0, lag_s=0.0, detectors=DETECTORS
    )
    return folder, found


def test_rows_say_what_is_known(result):
    _, found = result
    rows = {row["name"]: row for row in found["rows"]}
    assert list(rows) == [
        "recorded motion",
        "recorded, mismatched speech",
        "on syllables",
        "frozen",
    ]
    together = rows["on syllables"]["beat_consistency"]
    assert together["audio_to_motion"]["lift"] > 0.8
    assert together["motion_to_audio"]["lift"] > 0.8
    assert together["audio_to_motion"]["interval"][0] > 0.7
    low, high = rows["recorded, mismatched speech"]["beat_consistency"]["motion_to_audio"][
        "interval"
    ]
    assert low < 0.02 < 0.2
    assert high > -0.02
    nothing = rows["frozen"]["beat_consistency"]
    assert nothing["motion_to_audio"]["lift"] == nothing["audio_to_motion"]["lift"] == 0
    assert nothing["clips_without_motion_beats"] == nothing["clips"]
    assert rows["frozen"]["motion"] == {
        "seam_ratio": None,
        "jitter_share": None,
        "wrist_speed": 0.0,
    }
    assert 0.05 < rows["recorded motion"]["motion"]["wrist_speed"] < 0.5
    assert 0.8 < rows["recorded motion"]["motion"]["seam_ratio"] < 1.2
    assert rows["recorded, mismatched speech"]["fgd"] is None
    assert rows["on syllables"]["fgd"]["fgd"] > rows["recorded motion"]["fgd"]["fgd"]


def test_the_profile_peaks_where_the_motion_beats(result):
    _, found = result
    rows = {row["name"]: row for row in found["rows"]}
    for lifts in rows["on syllables"]["lift_profile"].values():
        assert found["lags_s"][int(np.argmax(lifts))] == 0


def test_the_files_hold_what_was_returned(result):
    folder, found = result
    assert json.loads((folder / "synchrony.json").read_text()) == json.loads(json.dumps(found))
    page = (folder / "synchrony.md").read_text()
    assert "| on syllables" in page
    assert "frozen: 6 of 6 clips without motion beats" in page
    assert "follow motion by 0 s, as given" in page
    assert (folder / "synchrony.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in folder.iterdir()) == [
        "synchrony.json",
        "synchrony.md",
        "synchrony.png",
    ]


def test_the_lag_comes_from_the_training_part(store, encoder, tmp_path, capsys):
    found = synchrony(store, encoder, "test", tmp_path, {}, seed=0, detectors=DETECTORS, limit=3)
    assert found["lag_from_training_part"]
    assert found["lag_s"] in LAGS_S
    assert "where recorded training motion is most consistent" in capsys.readouterr().out
    # three recordings are too few for intervals
    assert found["rows"][0]["beat_consistency"]["motion_to_audio"]["interval"] is None


@pytest.mark.parametrize("lead", [0.25, -0.35])
def test_a_lead_is_found_and_lateness_is_not_excused(lead):
    rng = np.random.default_rng(0)
    clips = []
    for i in range(6):
        spoken = np.cumsum(rng.uniform(0.4, 1.6, 60))
        clips.append(BeatClip(f"r{i}", spoken - lead, spoken, spoken[-1] + 1))
    lag = lag_of(clips, seed=0)
    assert 0 <= lag <= 0.4
    if lead > 0:
        assert lag == lead
    else:
        assert beat_consistency(clips, lag_s=lag).motion_to_audio.lift.value < 0.3
        assert beat_consistency(clips, lag_s=lead).motion_to_audio.lift.value > 0.9


def test_seams_jitter_and_speed_by_hand():
    """A wrist that moves 1 cm per frame, and 5 cm where windows of 8 frames meet."""
    steps = np.where(np.arange(1, 80) % 8 == 0, 0.05, 0.01)
    positions = np.zeros((80, 10, 3), np.float32)
    positions[1:, WRISTS[0], 0] = np.cumsum(steps)
    moving = how_it_moves([Motion(UPPER_BODY, 15.0, positions)])
    assert moving.seam_ratio == pytest.approx(5, rel=1e-4)
    assert moving.wrist_speed == pytest.approx(steps.mean() * 15 / 2, rel=1e-4)
    slow, shaking = (
        0.1 * np.sin(2 * np.pi * hertz * np.arange(120) / 15).astype(np.float32) for hertz in (1, 6)
    )
    shares = []
    for path in (slow, shaking):
        positions = np.zeros((120, 10, 3), np.float32)
        positions[:, WRISTS[1], 2] = path
        shares.append(how_it_moves([Motion(UPPER_BODY, 15.0, positions)]).jitter_share)
    assert shares[0] < 0.01
    assert shares[1] > 0.99


def test_speech_of_others_is_cut_to_length():
    clips = [
        BeatClip("a", np.array([1.0, 5.0]), np.array([2.0]), 6.0),
        BeatClip("b", np.array([0.5]), np.array([1.0, 3.5]), 4.0),
        BeatClip("b", np.array([0.7]), np.array([1.2, 3.7]), 4.0),
    ]
    found = mismatched_clips(clips, 1, np.random.default_rng(0))
    assert [clip.recording for clip in found] == ["a", "b", "b"]
    assert found[0].duration == 4
    assert found[0].motion_beats.tolist() == [1.0]
    assert found[1].audio_beats.tolist() == [2.0]
    assert mismatched_clips(clips[1:], 5, np.random.default_rng(0)) == []


def test_motion_that_does_not_cover_the_speech_is_named(store, encoder, tmp_path):
    def short(speech, speaker):
        motion = on_syllables(speech, speaker)
        return motion.slice(0, len(motion) - 40)

    with pytest.raises(CospeechError, match=r"short made .* s of motion for recording"):
        synchrony(store, encoder, "test", tmp_path, {"short": short}, seed=0, detectors=DETECTORS)
    assert list(tmp_path.iterdir()) == []
