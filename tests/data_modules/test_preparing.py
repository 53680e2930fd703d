"""How stores are prepared, on the embedded corpus and a folder of BVH."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.store import SCHEMA_VERSION
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.bvh import write_bvh
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from data_modules.mocap import MocapData
from data_modules.synthetic import SyntheticData
from tests.fabricated.sound import save_wav

COMMON = {
    "batch_size": 8,
    "seed": 0,
    "val_share": 0.2,
    "test_share": 0.2,
    "split_seed": 0,
    "strict": False,
    "max_recordings": None,
}

JOINTS = [
    "Hips",
    "Spine",
    "Spine1",
    "Spine2",
    "Neck",
    "Head",
    "LeftShoulder",
    "LeftArm",
    "LeftForeArm",
    "LeftHand",
    "RightShoulder",
    "RightArm",
    "RightForeArm",
    "RightHand",
    "LeftUpLeg",
    "RightUpLeg",
]
PARENTS = (-1, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 0, 0)
OFFSETS = np.array(
    [
        [0, 0, 0],
        [0, 0.1, 0],
        [0, 0.1, 0],
        [0, 0.1, 0],
        [0, 0.28, 0],
        [0, 0.1, 0],
        [0.05, 0.22, 0],
        [0.13, 0, 0],
        [0, -0.28, 0],
        [0, -0.25, 0],
        [-0.05, 0.22, 0],
        [-0.13, 0, 0],
        [0, -0.28, 0],
        [0, -0.25, 0],
        [0.1, -0.05, 0],
        [-0.1, -0.05, 0],
    ]
)


def write_take(folder, name, seconds=20.0, seed=0):
    """A take of 30 fps with swinging arms and a matching wav, without a transcript."""
    rng = np.random.default_rng(seed)
    frames = round(seconds * 30)
    rotations = np.tile(np.array([0, 0, 0, 1], dtype=np.float32), (frames, len(JOINTS), 1))
    angle = 0.5 * np.sin(np.arange(frames) / 30 * rng.uniform(2, 4))
    for joint in (7, 11):
        rotations[:, joint, 0] = np.sin(angle / 2)
        rotations[:, joint, 3] = np.cos(angle / 2)
    skeleton = Skeleton("made", tuple(JOINTS), PARENTS, OFFSETS)
    hips = np.tile([0.0, 1.0, 0.0], (frames, 1))
    positions = skeleton_positions(skeleton, rotations, hips).astype(np.float32)
    write_bvh(folder / f"{name}.bvh", Motion(skeleton, 30.0, positions, rotations))
    save_wav(folder / f"{name}.wav", rng.normal(0, 0.1, round(seconds * 16_000)).astype("f4"))


@pytest.fixture(scope="module")
def bvh_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bvh")
    for i in range(3):
        write_take(folder, f"{'ab'[i % 2]}_{i}", seed=i)
    return folder


def synthetic(store_dir, **changes):
    settings = {"minutes": 4, "corpus_seed": 0, "speakers": 2, "split": "recordings"}
    return SyntheticData(store_dir=str(store_dir), **{**COMMON, **settings, **changes})


def mocap(store_dir, root, **changes):
    settings = {
        "speaker": "prefix",
        "frame_rate": None,
        "joint_map": None,
        "missing_audio": "auto",
        "licence": "test",
        "split": "time_blocks",
    }
    return MocapData(root=str(root), store_dir=str(store_dir), **{**COMMON, **settings, **changes})


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"minutes": 0}, "data.minutes=0: "),
        ({"minutes": -1.5}, "data.minutes=-1.5: "),
        ({"minutes": float("nan")}, "data.minutes=nan: "),
        ({"minutes": float("inf")}, "data.minutes=inf: "),
        ({"speakers": 0}, "data.speakers=0: "),
        ({"corpus_seed": -1}, "data.corpus_seed=-1: "),
    ],
)
def test_a_synthetic_corpus_of_nothing_is_refused_by_its_setting(tmp_path, changes, problem):
    with pytest.raises(ConfigError) as caught:
        synthetic(tmp_path, **changes)
    assert caught.value.problem.startswith(problem)


def test_four_minutes_are_one_corpus_however_they_are_written(tmp_path):
    whole, point = synthetic(tmp_path, minutes=4), synthetic(tmp_path, minutes=4.0)
    assert json.dumps(point.settings()) == json.dumps(whole.settings())
    assert synthetic(tmp_path, minutes=4.5).settings()["minutes"] == 4.5


def test_another_split_of_the_same_recordings_reads_nothing_again(tmp_path, bvh_folder):
    first = mocap(tmp_path, bvh_folder).prepare_store()
    other = mocap(tmp_path, bvh_folder, val_share=0.3, test_share=0.3)
    other.sources  # noqa: B018  found, but none is read:
    other.__dict__["sources"] = [replace(source, read=None) for source in other.sources]
    second = other.prepare_store()
    for stream in ("positions.bin", "audio.bin"):
        assert (first.path / stream).stat().st_ino == (second.path / stream).stat().st_ino
    assert second.splits != first.splits
    assert second.fingerprint != first.fingerprint
    assert second.facts()["mean_direction"] != first.facts()["mean_direction"]
    written = second.manifest
    read = mocap(tmp_path / "elsewhere", bvh_folder, val_share=0.3, test_share=0.3).prepare_store()
    assert written == read.manifest


def test_motion_in_the_store_is_posed_by_its_rotations(tmp_path, bvh_folder):
    store = mocap(tmp_path, bvh_folder).prepare_store()
    for i in range(len(store.recordings)):
        motion = store.motion(i)
        roots = motion.positions[:, 0]
        posed = skeleton_positions(motion.skeleton, motion.rotations_local, roots)
        np.testing.assert_allclose(posed, motion.positions, atol=1e-4)


def test_a_store_of_an_earlier_schema_is_built_again(tmp_path, bvh_folder, monkeypatch):
    for module in ("data_modules.base", "cospeech.corpus.store", "cospeech.corpus.store_writer"):
        monkeypatch.setattr(f"{module}.SCHEMA_VERSION", 3)
    earlier = mocap(tmp_path, bvh_folder).prepare_store()
    assert earlier.manifest["schema"] == 3
    monkeypatch.undo()
    store = mocap(tmp_path, bvh_folder).prepare_store()
    assert store.manifest["schema"] == SCHEMA_VERSION
    assert store.path != earlier.path
    assert store.motion(0).rotations_local is not None


def test_a_bad_recording_is_skipped_with_its_reason(tmp_path, bvh_folder):
    for path in bvh_folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    bad = tmp_path / "c_9.bvh"
    bad.write_text((tmp_path / "a_0.bvh").read_text().replace("Frames: 600", "Frames: 7669"))
    (tmp_path / "c_9.wav").write_bytes((tmp_path / "a_0.wav").read_bytes())
    store = mocap(tmp_path / "stores", tmp_path).prepare_store()
    assert [recording.id for recording in store.recordings] == ["a_0", "a_2", "b_1"]
    (skipped,) = store.manifest["skipped"]
    assert skipped["id"] == "c_9"
    assert "7669" in skipped["reason"]
    with pytest.raises(CospeechError, match="7669"):
        mocap(tmp_path / "strict", tmp_path, strict=True).prepare_store()
    assert not list((tmp_path / "strict").glob("mocap*"))
    with pytest.raises(CospeechError, match="c_9"):  # the store that skipped it is there already
        mocap(tmp_path / "stores", tmp_path, strict=True).prepare_store()


def test_the_synthetic_truth_is_kept(tmp_path):
    store = synthetic(tmp_path).prepare_store()
    annotations = store.annotations(0)
    assert annotations["id"] == store.recordings[0].id
    assert {"style", "gestures"} <= set(annotations)
    phases = store.phases(0)
    assert len(phases) == len(store.motion(0))


def test_held_out_speakers_never_train(tmp_path):
    store = synthetic(tmp_path, split="speakers", speakers=4, minutes=6).prepare_store()
    training = set(store.speaker_ids)
    for split in ("val", "test"):
        for span in store.splits[split]:
            assert store.recordings[span.recording].speaker not in training


def test_debug_runs_count_recordings_that_can_be_used(tmp_path, bvh_folder):
    for path in bvh_folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "a_.bvh").write_text("HIERARCHY")
    (tmp_path / "a_.wav").write_bytes((tmp_path / "a_0.wav").read_bytes())
    store = mocap(tmp_path / "stores", tmp_path, max_recordings=2).prepare_store()
    assert [recording.id for recording in store.recordings] == ["a_0", "a_2"]


def test_a_debug_run_killed_at_its_very_end_reads_nothing_more(tmp_path, bvh_folder, monkeypatch):
    whole = mocap(tmp_path / "whole", bvh_folder, max_recordings=2).prepare_store()
    module = mocap(tmp_path / "killed", bvh_folder, max_recordings=2)

    def kill(writer):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(module, "_spans", kill)
        with pytest.raises(KeyboardInterrupt):
            module.prepare_store()
    store = module.prepare_store()
    assert store.manifest["sources"] == whole.manifest["sources"] == 2
    assert (store.path / "manifest.json").read_bytes() == (
        whole.path / "manifest.json"
    ).read_bytes()


def test_a_link_to_nothing_is_one_bad_recording(tmp_path, bvh_folder):
    for path in bvh_folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "b_7.bvh").symlink_to(tmp_path / "gone.bvh")
    (tmp_path / "b_7.wav").write_bytes((tmp_path / "a_0.wav").read_bytes())
    store = mocap(tmp_path / "stores", tmp_path).prepare_store()
    assert len(store.recordings) == 3
    assert [item["id"] for item in store.manifest["skipped"]] == ["b_7"]


def test_a_moved_corpus_is_the_same_corpus(tmp_path, bvh_folder):
    moved = tmp_path / "elsewhere" / bvh_folder.name
    moved.mkdir(parents=True)
    for path in bvh_folder.iterdir():
        (moved / path.name).write_bytes(path.read_bytes())
        stat = path.stat()
        os.utime(moved / path.name, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    (tmp_path / "link").mkdir()
    (tmp_path / "link" / bvh_folder.name).symlink_to(moved)
    parameters = mocap(tmp_path, bvh_folder).store_parameters()
    assert mocap(tmp_path, moved).store_parameters() == parameters
    link = tmp_path / "link" / bvh_folder.name
    assert mocap(tmp_path, link).store_parameters() == parameters
    os.utime(moved / "a_0.bvh")
    assert mocap(tmp_path, moved).store_parameters() != parameters
