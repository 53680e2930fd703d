"""The 3-D extension: axes, joints, audio, streaming, and files that lie."""

import io
import os
import re
import tracemalloc
import zipfile
from itertools import product

import numpy as np
import pytest

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.berkeley.extension3d import (
    Conventions,
    find_3d_sources,
    measure_conventions,
    read_items,
)
from cospeech.formats.berkeley.hands3d import BERKELEY_3D, FILE_JOINTS
from cospeech.formats.npz_file import NpzReader
from cospeech.motion.upper_body import doubts_about, find_joint_map, to_upper_body
from data_modules.berkeley import BerkeleyData
from tests.fabricated.berkeley import (
    BODY_NAMES,
    camera_bodies,
    coordinate_major,
    npy_header,
    tone,
    write_3d,
)

# As the data's readme prints them: the parent of each of the 55 joints.
PUBLISHED_PARENTS = [
    1, 11, 1, 2, 3, 1, 5, 6, 10, 10, -1, 10, 1, 13, 13, 14, 15, 13, 17, 18, 13, 20, 21, 13, 23, 24,
    13, 26, 27, 16, 19, 22, 25, 28, 34, 34, 35, 36, 34, 38, 39, 34, 41, 42, 34, 44, 45, 34, 47, 48,
    37, 40, 43, 46, 49,
]  # fmt: skip


def read_all(folder, **choice):
    return [item for source in find_3d_sources(folder, **choice) for item in source.read()]


def test_parents_are_the_published_ones_with_hands_on_wrists():
    assert FILE_JOINTS[:13] == BODY_NAMES
    parents = {
        joint: None if parent < 0 else BERKELEY_3D.joints[parent]
        for joint, parent in zip(BERKELEY_3D.joints, BERKELEY_3D.parents, strict=True)
    }
    for joint, parent in zip(FILE_JOINTS, PUBLISHED_PARENTS, strict=True):
        if joint in ("r_hand", "l_hand"):
            assert FILE_JOINTS[parent] == joint
            assert parents[joint] == joint.replace("hand", "wrist")
        else:
            assert parents[joint] == (None if parent < 0 else FILE_JOINTS[parent])
    assert len(BERKELEY_3D.mirror_pairs) == 4 + 21
    assert FILE_JOINTS[20] == "r_little0"  # little before ring
    assert FILE_JOINTS[50] == "l_index3"  # tips last


def test_positions_by_hand(tmp_path):
    write_3d(tmp_path / "oliver", counts={"train_noduplication": 2})
    recording = read_all(tmp_path)[1]
    points = camera_bodies(64, seed=1)
    joint = BERKELEY_3D.index
    positions = recording.motion.positions
    assert recording.motion.fps == 15
    assert positions.dtype == np.float32
    # x stays, y and z turn: camera axes to house axes.
    np.testing.assert_allclose(
        positions[:, joint["l_wrist"]], points[:, 7] * [1, -1, -1], atol=1e-6
    )
    np.testing.assert_allclose(positions[9, joint["head_top"]], [0, 0.62, 0], atol=1e-6)
    assert positions[:, joint["l_shoulder"], 0].min() > 0.1
    assert positions[:, joint["r_wrist"], 2].min() > 0.1
    # The hand's root is the wrist; the second index joint is (-3, 4, -1) cm from it in the file.
    np.testing.assert_array_equal(positions[:, joint["r_hand"]], positions[:, joint["r_wrist"]])
    offset = positions[:, joint["r_index1"]] - positions[:, joint["r_wrist"]]
    np.testing.assert_allclose(offset, np.tile([-0.03, -0.04, 0.01], (64, 1)), atol=1e-6)


def test_the_joint_map_fits_and_the_body_looks_right(tmp_path):
    write_3d(tmp_path / "oliver")
    recording = read_all(tmp_path)[0]
    assert find_joint_map(recording.motion.skeleton).name == "berkeley3d"
    upper = to_upper_body(recording.motion)
    assert doubts_about(upper) == []
    left_wrist = recording.motion.positions[:, BERKELEY_3D.index["l_wrist"]]
    spine = recording.motion.positions[:, BERKELEY_3D.index["spine"]]
    # The hips point to +x already, so the upper body is only moved.
    np.testing.assert_allclose(upper.positions[:, 6], left_wrist - spine, atol=1e-6)


@pytest.mark.parametrize("signs", list(product((1.0, -1.0), repeat=3)))
@pytest.mark.parametrize("hands", ["at origin", "at wrists"])
def test_axes_are_measured_on_the_bodies(tmp_path, signs, hands):
    def change(points):
        points = points.copy()
        if hands == "at wrists":
            points[:, 13:34] += points[:, 4:5]
            points[:, 34:] += points[:, 7:8]
        return points * signs

    write_3d(tmp_path / "plain", counts={"train_noduplication": 2})
    write_3d(tmp_path / "changed", counts={"train_noduplication": 2}, change=change)
    plain, changed = read_all(tmp_path / "plain"), read_all(tmp_path / "changed")
    for expected, found in zip(plain, changed, strict=True):
        difference = expected.motion.positions - found.motion.positions
        assert np.abs(difference).max() < 1e-6
    x, y, z = signs
    assert changed[0].annotations["axes"] == [x, -y, -z]
    assert changed[0].annotations["hands_at_origin"] == (hands == "at origin")


def test_without_evidence_of_depth_data_is_right_handed():
    points = camera_bodies(64, seed=0)
    points[..., 2] = 0
    assert measure_conventions(coordinate_major(points)[None]) == Conventions()
    assert measure_conventions(np.full((1, 64, 165), np.nan)) == Conventions()


def test_splits_ids_and_audio(tmp_path):
    write_3d(tmp_path)
    items = {item.id: item for item in read_all(tmp_path)}
    assert sorted(items) == sorted(
        [f"oliver-train-{i:06d}" for i in range(6)]
        + [f"oliver-val-{i:06d}" for i in range(3)]
        + [f"oliver-test-{i:06d}" for i in range(2)]
    )
    assert {item.split for item in items.values()} == {"train", "val", "test"}
    for name, frames, samples in (("train-000003", 64, 68267), ("test-000001", 192, 204800)):
        item = items[f"oliver-{name}"]
        assert len(item.motion) == frames
        assert len(item.speech.waveform) == samples == round(frames / 15 * 16000)
        expected = tone(samples, int(name[-6:])).astype(np.float32)
        np.testing.assert_array_equal(item.speech.waveform, expected)
        assert item.speech.words is None
    image = "/path/to/oliver/frames/3_63.jpg"
    assert items["oliver-train-000003"].annotations["last_image"] == image


def test_which_files_are_read(tmp_path):
    counts = {"train": 3, "train_noduplication": 1, "dev": 2, "dev_noduplication": 1, "test": 1}
    write_3d(tmp_path / "oliver", "oliver", counts)
    write_3d(tmp_path / "seth", "seth", {"train": 1})
    matching = read_all(tmp_path)
    assert [item.source for item in matching] == [
        "dev_oliver_noduplication_data.npz, item 0",
        "test_oliver_data.npz, item 0",
        "train_oliver_noduplication_data.npz, item 0",
    ]
    pairs = read_all(tmp_path, chunks="pairs", speakers=["oliver"])
    assert [item.split for item in pairs] == ["val"] * 2 + ["test"] + ["train"] * 3
    assert {item.annotations["chunks"] for item in pairs if item.split != "test"} == {"pairs"}
    with pytest.raises(CospeechError, match=r"no train_seth_noduplication_data.npz") as caught:
        find_3d_sources(tmp_path, speakers=["seth"])
    assert "train_seth_data.npz" in caught.value.problem
    assert "data.chunks" in caught.value.hint
    with pytest.raises(CospeechError, match="is not a folder"):
        find_3d_sources(tmp_path / "oliver" / "frames")


def same(first, second):
    return first.id == second.id and all(
        np.array_equal(a, b)
        for a, b in (
            (first.motion.positions, second.motion.positions),
            (first.speech.waveform, second.speech.waveform),
        )
    )


def test_blocks_in_any_order_stored_or_compressed(tmp_path):
    counts = {"train_noduplication": 66}
    write_3d(tmp_path / "stored", counts=counts, images=False, dtype="<f4")
    write_3d(tmp_path / "packed", counts=counts, images=False, dtype="<f4", compressed=True)
    stored, packed = find_3d_sources(tmp_path / "stored"), find_3d_sources(tmp_path / "packed")
    assert [source.id[-6:] for source in stored] == ["000000", "000064"]
    assert [source.id for source in packed] == [source.id for source in stored]
    forwards = [list(source.read()) for source in stored]
    backwards = [list(source.read()) for source in reversed(packed)][::-1]
    assert [len(items) for items in forwards] == [64, 2]
    for first, second in zip(forwards, backwards, strict=True):
        assert all(same(a, b) for a, b in zip(first, second, strict=True))


@pytest.mark.parametrize("compressed", [False, True])
def test_memory_does_not_grow_with_the_file(tmp_path, compressed):
    counts = {"train_noduplication": 140}
    path = write_3d(tmp_path, counts=counts, compressed=compressed)["train_noduplication"]
    if not compressed:
        assert path.stat().st_size > 60e6
    sources = find_3d_sources(tmp_path)
    tracemalloc.start()
    count = sum(1 for source in sources for _ in source.read())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 140
    # Sixteen bodies of 84 kB are looked at for the axes, then it is one item at a time.
    assert peak < 6e6


def test_int16_audio_and_other_lengths(tmp_path):
    body = coordinate_major(camera_bodies(64, 0))[None]
    wav = (np.arange(67267, dtype=np.int64) % 30000).astype(np.int16)[None]
    np.savez(tmp_path / "train_oliver_noduplication_data.npz", wav=wav, body=body)
    (item,) = read_all(tmp_path)
    assert len(item.speech.waveform) == 68267
    np.testing.assert_array_equal(item.speech.waveform[:67267], wav[0] / np.float32(32768))
    assert not item.speech.waveform[67267:].any()


def test_items_with_broken_values_are_left_out(tmp_path):
    body = np.repeat(coordinate_major(camera_bodies(64, 0))[None], 5, axis=0)
    wav = np.zeros((5, 68267), np.float32)
    body[1, 3, 7] = np.nan
    body[2, 3, 7] = 1e4
    wav[3, 5] = np.inf
    wav[4, 5] = 20000
    np.savez(tmp_path / "train_oliver_noduplication_data.npz", wav=wav, body=body)
    items = read_all(tmp_path)
    assert isinstance(items[0], Recording)
    assert all(isinstance(item, Dropped) and item.is_fault for item in items[1:])
    assert "item 2" in items[2].reason
    assert "NaN or infinite samples" in items[3].reason
    assert "full scale is 1" in items[4].reason


# Files that lie ---------------------------------------------------------------------------------

NAME = "train_oliver_noduplication_data.npz"


class Trap:
    """Unpickling it makes a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


def good_arrays(count=3):
    body = np.stack([coordinate_major(camera_bodies(64, i)) for i in range(count)])
    return {"wav": np.zeros((count, 68267), np.float32), "body": body}


def problem_of(folder):
    with pytest.raises(InputFileError) as caught:
        read_all(folder)
    assert NAME in str(caught.value)
    return str(caught.value)


def test_pickles_are_never_read(tmp_path):
    sprung = tmp_path / "sprung"
    objects = np.empty((3, 64, 165), object)
    objects[:] = Trap(str(sprung))
    np.savez(tmp_path / NAME, **good_arrays() | {"body": objects})
    assert "never done" in problem_of(tmp_path)
    # Unneeded members don't matter: they are not opened.
    np.savez(tmp_path / NAME, **good_arrays(), imgs=objects[:, :, 0], more=objects)
    assert len(read_all(tmp_path)) == 3
    assert not sprung.exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body": None}, "has no array 'body'; it has wav"),
        ({"body": np.zeros((3, 64, 3, 55))}, r"expected (items, frames, 165)"),
        ({"body": np.zeros((3, 64, 165), np.int32)}, "of floats"),
        ({"body": np.zeros((0, 64, 165))}, "holds 0 items"),
        ({"body": np.zeros((3, 1, 165))}, "of 1 frames"),
        ({"wav": np.zeros((2, 68267))}, "expected (3, samples)"),
        ({"wav": np.zeros((3, 68267), np.int64)}, "floats or int16"),
        ({"wav": np.zeros((3, 204800), np.float32)}, "64 frames at 15 fps are 68267"),
        ({"body": np.asfortranarray(np.zeros((3, 64, 165)))}, "ascontiguousarray"),
        ({"body": np.zeros(3, [("x", "f4")])}, "holds values of the type"),
    ],
)
def test_wrong_arrays(tmp_path, change, message):
    arrays = {name: a for name, a in (good_arrays() | change).items() if a is not None}
    np.savez(tmp_path / NAME, **arrays)
    assert message in problem_of(tmp_path)


def with_member(path, content, name="body.npy"):
    buffer = io.BytesIO()
    np.save(buffer, good_arrays()["wav"])
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("wav.npy", buffer.getvalue())
        archive.writestr(name, content)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy_header((30, 64, 165), "<f8") + bytes(100), "is not the 228 bytes it has"),
        (npy_header((2**40, 2**40, 2**40), "<f8"), "is not the 128 bytes"),
        (npy_header((2**60, 64, 165), "<f8"), "claims the shape"),
        (npy_header((-3, 64, 165), "<f8"), "claims the shape"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + bytes(50), "header can't be read"),
        (b"\x93NUMPY\x01\x00\x10\x00{'descr': " + bytes(50), "header can't be read"),
        (b"\x93NUMPY\x01\x00\x00\x20" + b"(" * 8192, "header can't be read"),
        (b"\x93NUMPY\x03\x00" + bytes(50), "not a numpy array"),
        (b"\x80\x04\x95 a pickle", "not a numpy array"),
        (b"", "not a numpy array"),
    ],
)
def test_lying_headers(tmp_path, content, message):
    with_member(tmp_path / NAME, content)
    assert message in problem_of(tmp_path)


def test_an_array_twice_or_too_many_members(tmp_path):
    with pytest.warns(UserWarning, match="Duplicate"):
        with_member(tmp_path / NAME, b"", "wav.npy")
    assert "two arrays called 'wav'" in problem_of(tmp_path)
    np.savez(tmp_path / NAME, **{f"a{i}": np.zeros(1) for i in range(65)})
    assert "holds 65 members" in problem_of(tmp_path)


def test_bombs(tmp_path):
    # 300 MB of zeros in 300 kB: no measured data, so it isn't begun.
    with zipfile.ZipFile(tmp_path / NAME, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, shape in (("body", (3600, 64, 165)), ("wav", (3600, 68267))):
            with archive.open(f"{name}.npy", "w") as member:
                member.write(npy_header(shape, "<f8" if name == "body" else "|u1"))
                for _ in range(300):
                    member.write(bytes(12 * shape[1] * (165 * 8 if name == "body" else 1)))
    assert (tmp_path / NAME).stat().st_size < 4e6
    tracemalloc.start()
    assert "not measured data" in problem_of(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_a_directory_that_claims_gigabytes(tmp_path):
    # The end record says that the directory is 20 MB long, and the file is that large: 400,000
    # empty members.
    entry = b"PK\x01\x02" + bytes(42)
    directory = entry * 400_000
    end = b"PK\x05\x06" + bytes(4) + (0xFFFF).to_bytes(2, "little") * 2
    end += len(directory).to_bytes(4, "little") + bytes(4) + bytes(2)
    (tmp_path / NAME).write_bytes(directory + end)
    tracemalloc.start()
    assert "more than any part" in problem_of(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 2e6
    tracemalloc.stop()


@pytest.mark.parametrize("compressed", [False, True])
def test_truncated_files(tmp_path, compressed):
    path = write_3d(tmp_path, counts={"train_noduplication": 2}, compressed=compressed)
    data = path["train_noduplication"].read_bytes()
    for length in (0, 10, 100, len(data) // 2, len(data) - 30, len(data) - 1):
        (tmp_path / NAME).write_bytes(data[:length])
        assert problem_of(tmp_path)
    # The end is there, the middle is not.
    (tmp_path / NAME).write_bytes(data[: len(data) // 3] + data[len(data) // 2 :])
    assert problem_of(tmp_path)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_flipped_bytes_raise_only_the_documented_error(tmp_path, save):
    path = tmp_path / NAME
    save(path, **good_arrays(1))
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    # Structure is at the members' beginnings and the file's end; values are everywhere else.
    places = [i for at in [m.start() for m in _signatures(data)] for i in range(at, at + 160)]
    places += list(range(len(data) - 200, len(data)))
    places += rng.integers(len(data), size=100).tolist()
    failed = 0
    for place in [p for p in places if p < len(data)][::2]:
        broken = bytearray(data)
        broken[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        try:
            items = list(read_items(str(path), "oliver", "train", 0, 1))
            assert len(items) == 1
        except InputFileError:
            failed += 1
    assert failed > 50


def _signatures(data):
    return re.finditer(rb"PK\x03\x04|PK\x01\x02|PK\x05\x06", data)


def test_rows_are_those_of_numpy(tmp_path):
    rng = np.random.default_rng(1)
    arrays = {"a": rng.normal(size=(50, 7)), "b": np.arange(30, dtype=">i4").reshape(15, 2)}
    arrays["t"] = np.array([["one", "two"], ["three", "four"]])
    np.savez(tmp_path / "s.npz", **arrays)
    np.savez_compressed(tmp_path / "c.npz", **arrays)
    for name in ("s.npz", "c.npz"):
        with NpzReader(tmp_path / name) as reader:
            for start, stop in ((3, 9), (40, 50), (0, 1), (7, 7)):
                np.testing.assert_array_equal(
                    reader.rows("a", start, stop), arrays["a"][start:stop]
                )
            np.testing.assert_array_equal(reader.rows("b", 2, 14), arrays["b"][2:14])
            assert reader.rows("t", 1, 2).tolist() == [["three", "four"]]
            with pytest.raises(ValueError, match="rows 40 to 51"):
                reader.rows("a", 40, 51)


# The data module --------------------------------------------------------------------------------


def data_module(tmp_path, **changes):
    settings = {
        "store_dir": str(tmp_path / "stores"), "batch_size": 4, "seed": 0, "split": "published",
        "val_share": 0.1, "test_share": 0.1, "split_seed": 0, "strict": True,
        "max_recordings": None, "root": str(tmp_path / "raw"), "kind": "auto", "speakers": None,
        "chunks": "matching",
    }  # fmt: skip
    return BerkeleyData(**settings | changes)


def test_a_store_of_the_3d_set(tmp_path):
    write_3d(tmp_path / "raw" / "oliver", counts={"train_noduplication": 66, "test": 2})
    write_3d(tmp_path / "raw" / "oliver", counts={"dev_noduplication": 2})
    data = data_module(tmp_path)
    assert (data.kind, data.corpus_name, data.upper_body) == ("3d", "berkeley3d", True)
    store = data.prepare_store()
    assert [len(store.splits[split]) for split in ("train", "val", "test")] == [66, 2, 2]
    span = store.splits["train"][65]
    expected = read_all(tmp_path / "raw")[-1]
    assert store.recordings[span.recording].id == expected.id == "oliver-train-000065"
    upper = to_upper_body(expected.motion).positions
    np.testing.assert_allclose(store.upper_body(span.recording, 0, 64), upper, atol=1e-6)


def test_settings_of_the_data_module(tmp_path):
    write_3d(tmp_path / "raw" / "oliver")
    with pytest.raises(ConfigError, match=r"data.kind=4d"):
        data_module(tmp_path, kind="4d")
    with pytest.raises(ConfigError, match=r"data.chunks=some"):
        data_module(tmp_path, chunks="some")
    (tmp_path / "raw" / "frames.csv").write_text("speaker\n")
    with pytest.raises(ConfigError, match=r"data.kind=2d or data.kind=3d"):
        data_module(tmp_path)
    first, second = (data_module(tmp_path, kind="3d", speakers=s) for s in (None, ["oliver"]))
    assert first.store_parameters() != second.store_parameters()
