"""Rotations in the store: kept where they are known, with the bones they turn."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.manifest import write_manifest
from cospeech.corpus.store import Store
from cospeech.corpus.synthetic import synthesise
from cospeech.errors import CospeechError, InputFileError
from cospeech.motion.bvh import read_bvh, write_bvh
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from tests.corpora import make_recording, make_store
from tests.fabricated.mocap import TRINITY_BODY, swinging


def turning(name, scale=1.0, root=(0.0, 1.0, 0.0)):
    """A recording whose joints turn, on a body of another size, walking."""
    skeleton = replace(TRINITY_BODY, offsets=TRINITY_BODY.offsets * scale)
    rotations = swinging(skeleton, name, 10.0, 15.0).rotations_local
    places = np.asarray(root) + np.linspace(0, 2, len(rotations))[:, None]
    motion = Motion(skeleton, 15.0, skeleton_positions(skeleton, rotations, places), rotations)
    return replace(make_recording(name), motion=motion)


def posed(motion):
    return skeleton_positions(motion.skeleton, motion.rotations_local, motion.positions[:, 0])


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Bodies of two sizes, and one recording of positions alone between them."""
    recordings = [turning("tall"), make_recording("still"), turning("small", 0.8), turning("last")]
    return make_store(tmp_path_factory.mktemp("mixed"), recordings)


def test_rotations_come_back_as_they_went_in(mixed):
    for i, name in ((0, "tall"), (3, "last")):
        found = mixed.motion(i).rotations_local
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, turning(name).motion.rotations_local)
    assert mixed.recordings.columns["has_rotations"] == [True, False, True, True]


def test_each_recording_has_its_own_bones(mixed):
    """One skeleton serves bodies of two sizes, as their joints are the same."""
    assert mixed.recordings.columns["skeleton"] == [0, 1, 0, 0]
    np.testing.assert_array_equal(
        mixed.motion(2).skeleton.offsets, turning("small", 0.8).motion.skeleton.offsets
    )
    for i in (0, 2, 3):
        motion = mixed.motion(i)
        np.testing.assert_allclose(posed(motion), motion.positions, atol=1e-5)


def test_positions_alone_have_no_rotations_and_cost_no_bytes(mixed):
    assert mixed.motion(1).rotations_local is None
    joints, frames = len(TRINITY_BODY), 150
    assert (mixed.path / "rotations_local.bin").stat().st_size == 3 * frames * joints * 16
    assert (mixed.path / "rest_offsets.bin").stat().st_size == 3 * joints * 24


def test_a_rotation_that_is_no_number_names_frame_and_joint(tmp_path):
    recording = turning("bad")
    recording.motion.rotations_local[7, 3, 1] = np.inf
    with pytest.raises(CospeechError, match=r"bad: NaN or infinite rotation at frame 7, joint Spi"):
        make_store(tmp_path, [recording])


@pytest.mark.parametrize(
    ("stream", "rows"), [("rotations_local", 1), ("rotations_local", -1), ("rest_offsets", 1)]
)
def test_a_manifest_that_counts_rotations_otherwise_is_refused(mixed, tmp_path, stream, rows):
    folder = shutil.copytree(mixed.path, tmp_path / "s")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["rows"][stream][0] += rows
    manifest["rows"][stream][2] -= rows  # the sum, and so the file's size, is the same
    write_manifest(folder, manifest)
    with pytest.raises(InputFileError, match=rf"rows\.{stream}"):
        Store(folder)


def test_the_embedded_corpus_is_posed_by_its_rotations(tmp_path):
    store = make_store(tmp_path, list(synthesise(minutes=1, seed=3, speakers=2))[:3])
    for i in range(len(store.recordings)):
        motion = store.motion(i)
        np.testing.assert_allclose(posed(motion), motion.positions, atol=1e-4)


def test_position_channels_give_a_file_its_bones(tmp_path):
    """A skeleton exported at another size than the person: the channels are the person's."""
    take = turning("walker").motion
    path = write_bvh(tmp_path / "a.bvh", take)
    read = read_bvh(path)
    long = replace(take.skeleton, offsets=take.skeleton.offsets.copy())
    long.offsets[take.skeleton.index["LeftForeArm"]] *= 1.2
    positions = skeleton_positions(long, take.rotations_local, take.positions[:, 0])
    again = read_bvh(write_bvh(path, replace(take, positions=positions)))
    np.testing.assert_allclose(posed(again), again.positions, atol=1e-4)
    assert np.abs(posed(replace(again, skeleton=read.skeleton)) - again.positions).max() > 0.01
    np.testing.assert_array_equal(again.skeleton.offsets[0], read.skeleton.offsets[0])
