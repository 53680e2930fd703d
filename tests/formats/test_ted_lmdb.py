"""TED databases as recordings and as windows of a store."""

import json
import math
from dataclasses import replace

import lmdb
import numpy as np
import pytest

from cospeech.corpus.packing import pack_source
from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats import ted_lmdb
from cospeech.formats.lmdb_values import list_keys, read_value
from cospeech.formats.ted import expressive
from cospeech.formats.ted.filters import PUBLISHED_RULES
from cospeech.formats.ted_lmdb import find_ted_sources, read_samples, read_video
from cospeech.motion.upper_body import EVALUATION_JOINTS, doubts_about, to_upper_body
from data_modules.ted import TedData
from tests.fabricated.ted import write_ted, write_values
from tests.fabricated.ted_clips import make_clip, make_poses, moved_clip

METRES_PER_UNIT = 4 / 3  # bones of 2.40 / 9 m on average, stored with 0.2
SPEC = WindowSpec(fps=15.0, frames=34, seed_frames=4, stride=10)
BASE = {
    "batch_size": 4, "seed": 0, "split": "published", "val_share": 0.1, "test_share": 0.1,
    "split_seed": 0, "strict": False, "max_recordings": None, "workers": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def fixture(shared):
    return shared / "data" / "ted_legacy_fixture"


@pytest.fixture(scope="module")
def cached(fixture):
    database = fixture / "lmdb_val_cache"
    return [read_value(database, key) for key in list_keys(database)]


def published_rules(fixture):
    means = json.loads((fixture / "cache_means.json").read_text())
    return replace(PUBLISHED_RULES, mean_pose=tuple(means["mean_pose"]))


def read_all(sources):
    return [item for source in sources for item in source.read()]


def test_each_video_is_a_source_and_each_clip_a_recording(fixture):
    sources = find_ted_sources(fixture)
    assert [source.id for source in sources] == [
        "lmdb_train/0000000000",
        "lmdb_train/0000000002",
        "lmdb_train/0000000003",
        "lmdb_val/0000000001",
    ]
    assert sources[0].files == (fixture / "lmdb_train" / "data.mdb",)
    recordings = read_all(sources)
    assert [(r.id, r.speaker, r.split) for r in recordings] == [
        ("synthTED_01_0", "synthTED_01", "train"),
        ("synthTED_01_1", "synthTED_01", "train"),
        ("synthTED_02_0", "synthTED_02", "train"),
        ("synthTED_02_1", "synthTED_02", "train"),
        ("synthTED_02_2", "synthTED_02", "train"),
        ("synthTED_03_0", "synthTED_03", "train"),
        ("synthTED_03_1", "synthTED_03", "train"),
        ("synthTED_04_0", "synthTED_04", "val"),
        ("synthTED_04_1", "synthTED_04", "val"),
    ]
    assert sum(len(recording.windows.starts) for recording in recordings[-2:]) == 26
    for recording in recordings:
        body = to_upper_body(recording.motion)
        assert recording.motion.skeleton.joints == EVALUATION_JOINTS
        assert doubts_about(body) == []


def test_windows_of_the_videos_are_the_cached_samples(fixture, cached):
    sources = find_ted_sources(fixture, kind="video", rules=published_rules(fixture))
    samples = iter(cached)
    for recording in read_all(sources)[-2:]:
        windows = recording.windows
        assert (windows.fps, windows.frames, windows.stride) == (15.0, 42, 10)
        for start, first in zip(windows.starts, windows.audio_starts, strict=True):
            words, poses, _, audio, _, aux = next(samples)
            house = recording.motion.positions[start : start + 42]
            expected = poses * [-1, -1, 1] * METRES_PER_UNIT
            np.testing.assert_allclose(house, expected, atol=1e-7)
            heard = recording.speech.waveform[first : first + 44800]
            np.testing.assert_array_equal(heard, audio[: len(heard)].astype(np.float32))
            begin_s, end_s = start / 15, (start + 42) / 15
            inside = [w for w in recording.speech.words if w.start < end_s and w.end > begin_s]
            assert [w.text for w in inside] == [text for text, _, _ in words]
            clip_s = recording.annotations["start_s"]
            assert aux["start_time"] == clip_s + begin_s
            np.testing.assert_allclose(
                [w.start + clip_s for w in inside], [a for _, a, _ in words], atol=1e-9
            )
    assert next(samples, None) is None


def test_cached_samples_are_recordings_of_one_window(fixture, cached):
    sources = find_ted_sources(fixture, kind="cache")
    assert [source.id for source in sources] == ["lmdb_val_cache/0000000000"]
    recordings = read_all(sources)
    assert [r.id for r in recordings] == [f"synthTED_04_{i:010}" for i in range(26)]
    for recording, (words, poses, _, audio, _, aux) in zip(recordings, cached, strict=True):
        assert recording.split == "val"
        assert recording.windows.starts.tolist() == recording.windows.audio_starts.tolist() == [0]
        expected = poses * [-1, -1, 1] * METRES_PER_UNIT
        np.testing.assert_allclose(recording.motion.positions, expected, atol=1e-7)
        np.testing.assert_array_equal(recording.speech.waveform, audio.astype(np.float32))
        first = recording.speech.words[0]
        assert (first.text, first.start) == (words[0][0], words[0][1] - aux["start_time"])


def test_a_fixed_number_of_samples_share_a_source(fixture, monkeypatch):
    monkeypatch.setattr(ted_lmdb, "SAMPLES_PER_SOURCE", 10)
    sources = find_ted_sources(fixture, kind="cache")
    assert [source.id[-2:] for source in sources] == ["00", "10", "20"]
    assert [len(list(source.read())) for source in sources] == [10, 10, 6]


def test_the_store_serves_what_the_published_loader_gives(fixture, cached, tmp_path):
    data = TedData(
        root=str(fixture), store_dir=str(tmp_path), kind="auto", published_windows=True, **BASE
    )
    data.attach(Wants())
    dataset = data.dataset("val")
    assert len(dataset) == 26
    batch = dataset.batch(range(26))
    vocabulary = data.prepare_store().vocabulary
    for row, (words, poses, _, audio, _, aux) in enumerate(cached):
        expected = poses[:34] * [-1, -1, 1] * METRES_PER_UNIT
        expected -= expected[:, :1]
        np.testing.assert_allclose(batch.positions[row], expected, atol=1e-6)
        np.testing.assert_allclose(batch.audio[row], audio[:36267].astype(float), atol=2e-5)
        on_frames = [0] * 34
        for text, start, _ in words:
            # the published loader's formula, on the video's clock
            end_s = aux["start_time"] + (aux["end_time"] - aux["start_time"]) * 34 / 42
            frame_s = (end_s - aux["start_time"]) / 34
            frame = max(0, math.floor((start - aux["start_time"]) / frame_s))
            if frame < 34:
                on_frames[frame] = vocabulary.index(text)
        assert batch.words[row].tolist() == on_frames


class Wants:
    """What the data module asks of a method."""

    window = SPEC
    needs = frozenset({"positions", "audio", "words", "speakers"})


def test_which_databases_are_taken(fixture, tmp_path):
    folder = tmp_path / "databases"
    folder.mkdir()
    for name in ("lmdb_train", "lmdb_val_cache", "lmdb_expressive"):
        (folder / name).symlink_to(fixture / name)
    assert [s.id.split("/")[0] for s in find_ted_sources(folder)] == [
        *["lmdb_train"] * 3,
        "lmdb_val_cache",
    ]
    (folder / "lmdb_val").symlink_to(fixture / "lmdb_val")
    assert find_ted_sources(folder)[-1].id == "lmdb_val/0000000001"
    with pytest.raises(ConfigError, match=r"data\.kind=videos: choose one of auto, video, cache"):
        find_ted_sources(folder, kind="videos")
    with pytest.raises(CospeechError, match=r"looked for lmdb_train/data\.mdb") as caught:
        find_ted_sources(tmp_path)
    assert "lmdb_train_cache/data.mdb" in str(caught.value)
    assert f"set data.root to its subfolder {folder.name}" in caught.value.hint
    with pytest.raises(CospeechError, match="nowhere is not a folder"):
        find_ted_sources(folder / "nowhere")
    with pytest.raises(CospeechError, match=r"is itself a database: set data\.root to the folder"):
        find_ted_sources(folder / "lmdb_train")


def test_a_database_of_the_other_kind_is_named(fixture):
    with pytest.raises(InputFileError, match=r"key 0000000000: holds a list .* cache database"):
        list(read_video(fixture / "lmdb_val_cache", b"0000000000"))
    with pytest.raises(InputFileError, match="key 0000000001: holds a video"):
        list(read_samples(fixture / "lmdb_val", (b"0000000001",)))


def test_unknown_joints_are_an_error_and_no_clips_are_not(fixture):
    database = fixture / "lmdb_expressive"
    with pytest.raises(
        InputFileError, match="key 0000000000, clip 0: 23 joints a frame; the TED set has 10, TED-"
    ):
        list(read_video(database, b"0000000000"))
    (empty,) = read_video(database, b"0000000001")
    assert (empty.id, empty.kind, empty.is_fault) == ("synthEXP_02", "no clip", False)


def plain(node):
    """A sidecar's description as the value it describes; arrays stay described."""
    match node["t"]:
        case "dict":
            return {plain(key): plain(item) for key, item in node["v"]}
        case "list":
            return [plain(item) for item in node["v"]]
        case "float":
            return float.fromhex(node["v"])
        case "str":
            return node["v"]
    return node


def described_videos(fixture, database):
    entries = json.loads((fixture / f"expected_{database}.json").read_text())["entries"]
    return [plain(entry["value"]) for entry in entries]


def test_a_recording_is_what_the_sidecars_say(fixture):
    """Clip 1 of the first video: its arrays and words as they were before they were written."""
    _, recording = find_ted_sources(fixture)[0].read()
    clip = described_videos(fixture, "lmdb_train")[0]["clips"][1]
    with np.load(fixture / "arrays_train_0000000000_clip1.npz") as arrays:
        poses, audio = arrays["skeletons_3d"].astype(np.float64), arrays["audio_raw"]
    np.testing.assert_array_equal(recording.speech.waveform, audio.astype(np.float32))
    seconds = clip["end_time"] - clip["start_time"]
    frames = math.ceil(seconds * 15)
    assert (recording.motion.fps, len(recording.motion)) == (15.0, frames)
    at = np.arange(frames) * len(poses) / (seconds * 15)
    inside = at <= len(poses) - 1
    assert inside.sum() > 100
    for joint, axis in np.ndindex(10, 3):
        line = np.interp(at, np.arange(len(poses)), poses[:, joint, axis])
        # half precision of numbers below 1
        expected = line * (-1, -1, 1)[axis] * 4 / 3
        found = recording.motion.positions[:, joint, axis]
        np.testing.assert_allclose(found[inside], expected[inside], atol=1e-3)
    assert [(w.text, w.start, w.end) for w in recording.speech.words] == [
        (text, start - clip["start_time"], end - clip["start_time"])
        for text, start, end in clip["words"]
    ]


def prepared(root, store_dir, **changes):
    settings = {"kind": "auto", "published_windows": True, **BASE, **changes}
    return TedData(root=str(root), store_dir=str(store_dir), **settings).prepare_store()


def test_vocabulary_and_speakers_are_the_published_ones(fixture, tmp_path):
    """docs/facts/trimodal.md, sections 3.8 and 3.9: words in raw clip order over the splits, an id
    for each training video."""
    videos = {name: described_videos(fixture, name) for name in ("lmdb_train", "lmdb_val")}
    words = [
        text
        for name in ("lmdb_train", "lmdb_val")
        for video in videos[name]
        for clip in video["clips"]
        for text, _, _ in clip["words"]
    ]
    store = prepared(fixture, tmp_path)
    specials = ["<PAD>", "<SOS>", "<EOS>", "<UNK>"]
    assert store.vocabulary == [*specials, *dict.fromkeys(words)]
    speakers = [video["vid"] for video in videos["lmdb_train"]]
    assert store.speaker_ids == {name: i for i, name in enumerate(speakers, 1)}


def test_words_of_what_gives_no_window_are_in_the_vocabulary_in_their_place(tmp_path):
    def saying(clip, *texts):
        times = np.linspace(clip["start_time"], clip["end_time"], len(texts) + 1)
        return clip | {
            "words": [
                [text, float(start), float(start) + 0.2]
                for text, start in zip(texts, times, strict=False)
            ]
        }

    good, short, still = make_clip(8.0), make_clip(2.0), make_clip(8.0, arm_swing=0.0)
    nan = {"skeletons_3d": np.full_like(good["skeletons_3d"], np.nan)}
    fields = [f for f in good if f != "audio_raw"]
    train = [
        saying(short, "one", "two"),
        saying(still, "three", "one"),
        saying(good, *["four", "five", "six", "seven", "eight"]),
        saying(good, "nine", "four") | nan,
        {f: saying(good, "ten")[f] for f in fields},
        saying(good, *["eleven", "twelve", "five", "six"]),
        saying(expressive_clip([(60, 400)]), *["a", "b", "c", "d", "e"]),
    ]
    for name, clips in (
        ("lmdb_test", [saying(good, "last", "one", "first")]),
        ("lmdb_val", [saying(still, "later")]),
        ("lmdb_train", train),
    ):
        values = [(i, {"vid": f"{name}{i}", "clips": [clip]}) for i, clip in enumerate(clips)]
        write_values(tmp_path / "raw" / name, iter(values))
    packed = [pack_source(source, True) for source in find_ted_sources(tmp_path / "raw")]
    assert list(dict.fromkeys(text for source in packed for text in source.texts)) == [
        *[
            "one",
            "two",
            "three",
            "four",
            "five",
            "six",
            "seven",
            "eight",
            "nine",
            "ten",
            "eleven",
            "twelve",
        ],
        *["a", "b", "c", "d", "e", "later", "last", "first"],
    ]


def video_of(monkeypatch, *clips, vid="vid"):
    """What `read_video` makes of a video with these clips."""
    monkeypatch.setattr(ted_lmdb, "read_value", lambda _, __: {"vid": vid, "clips": list(clips)})
    return list(read_video(ted_lmdb.Path("lmdb_train"), b"0000000007", "train"))


def test_damaged_clips_are_left_out_and_the_others_kept(monkeypatch):
    clip = make_clip(8.0)
    nan = clip["skeletons_3d"].copy()
    nan[40, 3, 2] = np.nan
    changes = [
        ({"skeletons_3d": nan}, "pose not a number"),
        ({"skeletons_3d": nan.reshape(len(nan), 30)}, "damaged"),
        ({"skeletons_3d": [[0.0]]}, "damaged"),
        ({"audio_raw": clip["audio_raw"][:0]}, "no audio"),
        ({"audio_raw": np.full(128000, np.inf, np.float16)}, "audio not a number"),
        ({"audio_raw": None}, "damaged"),
        ({"audio_feat": clip["audio_feat"][:, :200]}, "audio and motion differ in length"),
        ({"audio_feat": clip["audio_feat"].astype(str)}, "damaged"),
        ({"words": [["a", 1.0]]}, "damaged"),
        ({"words": "a"}, "damaged"),
        ({"words": [["a", float("nan"), 2.0]]}, "damaged"),
        ({"end_time": clip["start_time"]}, "times don't fit the frames"),
        ({"end_time": "soon"}, "damaged"),
        ({"start_time": -1e300}, "damaged"),
    ]
    clips = [{**clip, **change} for change, _ in changes]
    items = video_of(monkeypatch, *clips, {}, None, clip)
    assert [item.kind for item in items[:-1]] == [*(kind for _, kind in changes), *["damaged"] * 2]
    assert all(item.is_fault for item in items[:-1])
    assert items[0].id == "vid_0"
    assert "lmdb_train, key 0000000007, clip 0: pose 40 of 200 (1.60 s)" in items[0].reason
    assert isinstance(items[-1], Recording)
    assert items[-1].id == "vid_16"


def test_clips_without_a_window_are_left_out_by_rule(monkeypatch):
    clip = make_clip(8.0)
    leant = clip["skeletons_3d"].copy()
    leant[:, 1, 0] = 0.2
    silent = clip | {"words": clip["words"][:1]}
    items = video_of(
        monkeypatch, make_clip(2.7), make_clip(8.0, arm_swing=0.0), clip | {"skeletons_3d": leant},
        silent,
    )  # fmt: skip
    assert [item.kind for item in items] == [
        "shorter than a window",
        *["no window passed the filters"] * 3,
    ]
    assert "41 frames at 15 fps, a window has 42" in items[0].reason
    assert [item.reason.split(": ")[1:] for item in items[1:]] == [
        ["windows left out", "pose 8"],
        ["windows left out", "spine angle 8"],
        ["windows left out", "words 8"],
    ]
    assert not any(item.is_fault for item in items)


def test_counts_of_windows_left_out_stay_with_the_recording(monkeypatch):
    clip = make_clip(8.0)
    # from 5.5 s on one leans to the side: windows at 20 frames (1.33 s) and later touch it
    poses = clip["skeletons_3d"].copy()
    poses[round(4.1 * 25) :, 1, 0] = 0.2
    (recording,) = video_of(monkeypatch, clip | {"skeletons_3d": poses})
    assert recording.windows.starts.tolist() == [0, 10]
    assert recording.windows.dropped == {"spine angle": 6}


def test_ids_and_words_of_an_unusual_video(monkeypatch):
    clip = moved_clip(make_clip(8.0), 1000)
    (recording,) = video_of(monkeypatch, clip, vid="-a/b c_é")
    assert recording.id == "-a_b_c___0"
    assert recording.speaker == "-a/b c_é"
    assert recording.annotations["start_s"] == 40.0
    assert recording.speech.words[0].start == pytest.approx(-0.2)
    assert recording.speech.waveform.dtype == np.float32


def expressive_poses(frames):
    """43 joints from the ten: hands at the wrists, a face in front of the head; camera axes."""
    body = make_poses(frames, 25.0, 0).astype(np.float64) * [-1, 1, -1]
    spine, neck, head = body[:, 0], body[:, 1], body[:, 2]
    poses = np.empty((frames, 43, 3), np.float32)
    poses[:, :8] = np.stack(
        [spine, neck, body[:, 4], body[:, 7], body[:, 5], body[:, 8], body[:, 6], body[:, 9]], 1
    )
    poses[:, 8:23] = body[:, 6:7] + np.linspace(0.01, 0.1, 15)[:, None]
    poses[:, 23:38] = body[:, 9:10] + np.linspace(0.01, 0.1, 15)[:, None]
    face = np.array(
        [[0, 0, -0.1], [-0.03, -0.03, -0.08], [0.03, -0.03, -0.08], [-0.07, 0, 0], [0.07, 0, 0]]
    )
    poses[:, 38:] = head[:, None] + face
    return poses


def expressive_clip(missing=()):
    poses = expressive_poses(500)
    for first, stop in missing:
        poses[first:stop] = 0
    return make_clip(20.0) | {"skeletons_3d": list(poses)}


def test_expressive_clips_become_43_joints_in_house_axes(monkeypatch):
    (recording,) = video_of(monkeypatch, expressive_clip())
    motion = recording.motion
    assert (recording.id, motion.fps, len(motion)) == ("vid_0", 25.0, 500)
    assert recording.windows is None
    assert len(motion.skeleton) == 43
    parents = motion.skeleton.parents
    lengths = {
        name: np.linalg.norm(motion.positions[:, i] - motion.positions[:, parents[i]], axis=1)
        for name, i in motion.skeleton.index.items()
    }
    # the body's bones are those of the published table again
    for name, metres in (
        ("neck", 0.26),
        ("l_shoulder", 0.22),
        ("r_elbow", 0.36),
        ("l_wrist", 0.33),
    ):
        np.testing.assert_allclose(lengths[name], metres, atol=1e-3)
    # house axes: the left is at +x, the face looks along +z
    stored = {name: motion.positions[:, i] for name, i in motion.skeleton.index.items()}
    assert (stored["l_shoulder"][:, 0] > stored["r_shoulder"][:, 0] + 0.3).all()
    assert (stored["nose"][:, 1:] > stored["neck"][:, 1:] + [0.1, 0.05]).all()
    upper = to_upper_body(motion)
    assert doubts_about(upper) == []
    at = {name: upper.positions[:, i] for i, name in enumerate(EVALUATION_JOINTS)}
    assert (at["left_shoulder"][:, 0] > 0.1).all()
    # the shoulders are the heading
    np.testing.assert_allclose(at["left_shoulder"][:, 2], at["right_shoulder"][:, 2], atol=1e-6)


def test_short_gaps_are_filled_and_long_ones_cut(monkeypatch):
    whole = video_of(monkeypatch, expressive_clip())[0].motion.positions
    (filled,) = video_of(monkeypatch, expressive_clip([(100, 105)]))
    assert len(filled.motion) == 500
    expected = whole[99] + (whole[105] - whole[99]) * (np.arange(1, 6) / 6)[:, None, None]
    np.testing.assert_allclose(filled.motion.positions[100:105], expected, atol=2e-4)

    left_out, first, second = video_of(
        monkeypatch, expressive_clip([(0, 3), (200, 206), (490, 500)])
    )
    assert (left_out.kind, left_out.is_fault) == ("speaker not detected", False)
    assert "19 of 500 frames cut out" in left_out.reason
    assert [first.id, second.id] == ["vid_0-0", "vid_0-1"]
    assert [len(first.motion), len(second.motion)] == [197, 284]
    assert second.annotations["first_frame_in_clip"] == 206
    start_s, seconds = 206 / 25, 284 / 25
    assert len(second.speech.waveform) == math.ceil(seconds * 16000)
    clip = expressive_clip()
    audio = clip["audio_raw"][round(start_s * 16000) :].astype(np.float32)
    np.testing.assert_array_equal(second.speech.waveform, audio[: math.ceil(seconds * 16000)])
    expected_words = [
        (text, pytest.approx(start - 3 - start_s))
        for text, start, end in clip["words"]
        if end - 3 > start_s and start - 3 < start_s + seconds
    ]
    assert [(word.text, word.start) for word in second.speech.words] == expected_words

    (nothing,) = video_of(monkeypatch, expressive_clip([(0, 460)]))
    assert isinstance(nothing, Dropped)
    assert nothing.kind == "shorter than a window"
    (nobody,) = video_of(monkeypatch, expressive_clip([(0, 500)]))
    assert nobody.kind == "no motion"


def test_expressive_joints_are_those_of_the_published_direction_list():
    pairs = [
        (0, 1), (1, 2), (1, 3), (2, 4), (4, 6), (3, 5), (5, 7),
        (6, 8), (8, 9), (9, 10), (6, 11), (11, 12), (12, 13), (6, 14), (14, 15), (15, 16),
        (6, 17), (17, 18), (18, 19), (6, 20), (20, 21), (21, 22),
        (7, 23), (23, 24), (24, 25), (7, 26), (26, 27), (27, 28), (7, 29), (29, 30), (30, 31),
        (7, 32), (32, 33), (33, 34), (7, 35), (35, 36), (36, 37),
        (1, 38), (38, 39), (38, 40), (39, 41), (40, 42),
    ]  # fmt: skip
    assert sorted(expressive.SKELETON.bones) == sorted(pairs)
    assert expressive.SKELETON.joints[38:] == ("nose", "r_eye", "l_eye", "r_ear", "l_ear")
    assert len(expressive.SKELETON.mirror_pairs) == 20


def test_fabricated_databases_of_both_kinds_hold_the_same_windows(tmp_path):
    videos = read_all(find_ted_sources(write_ted(tmp_path, 12, 15.0)))
    samples = read_all(find_ted_sources(write_ted(tmp_path, 12, 15.0, cache=True), kind="cache"))
    recordings = [item for item in videos if isinstance(item, Recording)]
    assert {(r.split, r.speaker[-2:]) for r in recordings} >= {("test", "10"), ("val", "11")}
    for split in ("train", "val", "test"):
        cut = [
            recording.motion.positions[start : start + 42]
            for recording in recordings
            if recording.split == split
            for start in recording.windows.starts
        ]
        assert cut
        cached = [sample.motion.positions for sample in samples if sample.split == split]
        np.testing.assert_array_equal(cut, cached)


def test_a_damaged_sample_is_left_out_and_the_others_of_its_block_kept(tmp_path):
    write_ted(tmp_path, 1, 10.0, cache=True)
    (source,) = find_ted_sources(tmp_path, kind="cache")
    before = list(source.read())
    with (
        lmdb.open(str(source.files[0].parent), map_size=2**30) as database,
        database.begin(write=True) as writing,
    ):
        writing.put(b"0000000002", writing.get(b"0000000002")[:5000])
    (source,) = find_ted_sources(tmp_path, kind="cache")
    after = list(source.read())
    assert [item.id for item in after[:2] + after[3:]] == [r.id for r in before[:2] + before[3:]]
    damaged = after[2]
    assert isinstance(damaged, Dropped)
    assert (damaged.kind, damaged.is_fault) == ("damaged", True)
    assert "key 0000000002, byte " in damaged.reason


def test_samples_whose_parts_do_not_fit_are_left_out(fixture, monkeypatch):
    genuine = read_value(fixture / "lmdb_val_cache", b"0000000003")
    words, poses, directions, audio, spectrogram, aux = genuine
    changes = [
        ([words, poses[:40], directions, audio, spectrogram, aux], "damaged"),
        ([words, poses, directions[0, 0, 0], audio, spectrogram, aux], "damaged"),
        ([words, poses, np.float64(0).reshape(()), audio, spectrogram, aux], "damaged"),
        ([words, poses * np.nan, directions, audio, spectrogram, aux], "pose not a number"),
        ([words, poses, directions, audio[:0], spectrogram, aux], "no audio"),
        ([words, poses, directions, audio, spectrogram, aux | {"vid": 3}], "damaged"),
        ([words, poses, directions, audio, spectrogram, aux | {"start_time": None}], "damaged"),
    ]
    left_out = aux | {"is_correct_motion": False, "filtering_message": "motion"}
    values = [value for value, _ in changes]
    values += [[words, poses, directions, audio, spectrogram, left_out], genuine]
    monkeypatch.setattr(ted_lmdb, "read_value", lambda _, key: values[int(key)])
    keys = tuple(b"%d" % i for i in range(len(values)))
    *faults, marked, recording = read_samples(fixture / "lmdb_val_cache", keys, "val")
    assert [(item.kind, item.is_fault) for item in faults] == [(kind, True) for _, kind in changes]
    assert (marked.kind, marked.is_fault) == ("marked as incorrect motion", False)
    assert marked.words == tuple(text for text, _, _ in words)
    assert recording.split == "val"
