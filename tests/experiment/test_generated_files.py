"""What generate.py writes of a motion: arrays, a page, and BVH that other programs open."""

import numpy as np
import pytest
import torch

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import CospeechError
from cospeech.experiment import generating
from cospeech.methods.gesticulator import Gesticulator
from cospeech.motion.bvh import read_bvh
from cospeech.motion.upper_body import UPPER_BODY, to_upper_body
from cospeech.speech.speech import Speech
from tests.bvh_elsewhere import read_elsewhere
from tests.corpora import make_recording
from tests.fabricated.mocap import bursts


@pytest.fixture
def speech():
    return Speech(bursts("a", 3.02))


@pytest.fixture
def motion(speech):
    torch.manual_seed(0)
    method = Gesticulator(placeholder_facts(), text="none", initialisation="he")
    return method.generate(speech)


def test_a_generated_bvh_opens_elsewhere(motion, speech, tmp_path):
    told = generating._written(motion, speech, tmp_path, "a", 1.0)
    path = tmp_path / "motion.bvh"
    assert f"for a rig: {path}" in told
    theirs, skeleton = read_elsewhere(path), motion.skeleton
    joints = [joint for joint in skeleton.joints if joint not in skeleton.end_sites]
    assert sorted(theirs.names) == sorted(joints)
    for name, parent in zip(theirs.names, theirs.parents, strict=True):
        above = skeleton.parents[skeleton.index[name]]
        assert (parent < 0) is (above < 0)
        assert above < 0 or theirs.names[parent] == skeleton.joints[above]
    assert theirs.frame_s == pytest.approx(0.05, abs=1e-9)
    shown = [skeleton.index[name] for name in theirs.names]
    ours_cm = 100 * motion.positions[:, shown]
    assert len(ours_cm) == 61
    np.testing.assert_allclose(theirs.positions_world, ours_cm, atol=1e-3)
    # ... and it is no pose that nothing could tell from another.
    hands = motion.positions[:, [skeleton.index[f"{side}Hand"] for side in ("Left", "Right")]]
    assert (np.ptp(hands, axis=0).max(axis=-1) > 0.02).all()


def test_our_own_reader_finds_the_motion_again(motion, speech, tmp_path):
    generating._written(motion, speech, tmp_path, "a", 1.0)
    again = read_bvh(tmp_path / "motion.bvh")
    order = [again.skeleton.index[joint] for joint in motion.skeleton.joints]
    np.testing.assert_allclose(again.positions[:, order], motion.positions, atol=1e-5)


def test_the_arrays_are_the_ten_joints_of_whatever_comes_out(motion, speech, tmp_path):
    generating._written(motion, speech, tmp_path, "a", 1.0)
    with np.load(tmp_path / "motion.npz") as arrays:
        assert tuple(arrays["joints"]) == UPPER_BODY.joints
        np.testing.assert_array_equal(arrays["positions"], to_upper_body(motion).positions)
        assert arrays["fps"] == 20
    page = (tmp_path / "player.html").read_text()
    assert f'"joints":{len(motion.skeleton)},' in page, "the page shows the whole skeleton"


def test_a_motion_without_rotations_has_no_bvh(tmp_path):
    recording = make_recording("a", seconds=2)
    told = generating._written(recording.motion, recording.speech, tmp_path, "a", 1.0)
    assert "rig" not in told
    assert {path.name for path in tmp_path.iterdir()} == {"motion.npz", "player.html"}
    with np.load(tmp_path / "motion.npz") as arrays:
        np.testing.assert_array_equal(arrays["positions"], recording.motion.positions)


def test_the_bvh_is_kept_where_the_page_fails(motion, speech, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(generating, "write_player", full)
    with pytest.raises(CospeechError, match="the motion is whole") as caught:
        generating._written(motion, speech, tmp_path, "a", 1.0)
    assert str(tmp_path / "motion.bvh") in str(caught.value)
    assert (tmp_path / "motion.bvh").is_file()
