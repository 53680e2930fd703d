"""The 2-D set: tables, times, keypoints, audio, windows, the published normalisation."""

import csv
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.berkeley.audio import AudioFile, read_audio
from cospeech.formats.berkeley.interval_frames import (
    MAX_STRETCH_FRAMES,
    NTSC_FPS,
    frame_rate,
    sound_of,
    split_at_gaps,
)
from cospeech.formats.berkeley.keypoints import BERKELEY_2D, parse_keypoints
from cospeech.formats.berkeley.keypoints2d import find_2d_sources, read_intervals
from cospeech.formats.berkeley.layout import below, parse_time, recording_name, video_stem
from cospeech.formats.berkeley.published2d import (
    JON_SHOULDER_PX,
    from_channels,
    random_windows,
    scale_factors,
    speaker_statistics,
    to_channels,
    training_windows,
    window_audio_samples,
)
from cospeech.formats.berkeley.rows import index_rows
from data_modules.berkeley import BerkeleyData
from tests.fabricated.berkeley import clock_sound, stamp, write_2d, write_samples

# Speaker -> horizontal shoulder distance in pixels and scale factor, as published.
PUBLISHED_SCALES = {
    "almaram": (206.515, 1.518505), "angelica": (219.770, 1.426919),
    "chemistry": (284.823, 1.101014), "conan": (219.214, 1.430538), "ellen": (237.834, 1.318542),
    "jon": (313.594, 1.0), "oliver": (328.397, 0.954923), "rock": (103.142, 3.040410),
    "seth": (316.759, 0.990008), "shelly": (87.818, 3.570954),
}  # fmt: skip


def read_all(folder, **choice):
    return [item for source in find_2d_sources(folder, **choice) for item in source.read()]


def by_interval(items):
    return {item.annotations["interval"]: item for item in items if isinstance(item, Recording)}


def test_the_49_keypoints():
    names = BERKELEY_2D.joints
    assert len(names) == 49
    numbers = {"neck": 0, "right_wrist": 3, "left_shoulder": 4, "left_wrist": 6, "left_hand": 7,
               "left_thumb0": 8, "left_little3": 27, "right_hand": 28, "right_thumb0": 29,
               "right_little3": 48}  # fmt: skip
    assert {name: BERKELEY_2D.index[name] for name in numbers} == numbers
    # Links of the published code: 0-1-2-3-28, 0-4-5-6-7, five chains of four from 7 and from 28.
    links = {(0, 1), (1, 2), (2, 3), (3, 28), (0, 4), (4, 5), (5, 6), (6, 7)}
    for hand in (7, 28):
        for finger in range(5):
            chain = [hand, *range(hand + 1 + 4 * finger, hand + 5 + 4 * finger)]
            links |= set(pairwise(chain))
    assert set(BERKELEY_2D.bones) == links
    assert len(BERKELEY_2D.mirror_pairs) == 24


@pytest.mark.parametrize("columns", [49, 52])
def test_recordings_by_hand(tmp_path, columns):
    truth = write_2d(tmp_path, frames=80, columns=columns)
    items = read_all(tmp_path)
    assert len(items) == 12
    for name, item in by_interval(items).items():
        points = truth[item.speaker, name]["points"]
        points = np.delete(points, [7, 8, 9], axis=2)
        expected = points - points[:, :, :1]
        np.testing.assert_array_equal(item.motion.positions[..., 0], expected[:, 0])
        np.testing.assert_array_equal(item.motion.positions[..., 1], -expected[:, 1])
        assert item.motion.fps == NTSC_FPS
        assert item.split == {"dev": "val"}.get(*2 * [truth[item.speaker, name]["split"]])
        assert item.annotations["neck_px"] == [640.0, 300.0]
        assert item.annotations["points_at_origin"] == 0
        assert item.annotations["link"] == f"https://example.org/{item.speaker}"
    positions = items[0].motion.positions
    # The speaker's left is +x; their wrists hang below the neck.
    assert (positions[:, BERKELEY_2D.index["left_shoulder"]] == [100, -10]).all()
    assert (positions[:, BERKELEY_2D.index["right_shoulder"]] == [-100, -10]).all()
    assert (positions[:, BERKELEY_2D.index["left_little3"], 1] < -100).all()


@pytest.mark.parametrize("table", ["frames.csv", "frames_df_2_16_19.csv", "frames_df_10_19_19.csv"])
def test_table_names_and_row_order(tmp_path, table):
    write_2d(tmp_path / "a", ("oliver",), frames=70)
    write_2d(tmp_path / "b", ("oliver",), frames=70, table=table, shuffle=True)
    (tmp_path / "b" / "videos_links.csv").rename(tmp_path / "b" / "video_links.csv")
    expected, found = (by_interval(read_all(tmp_path / folder)) for folder in "ab")
    assert expected.keys() == found.keys()
    for name, item in expected.items():
        np.testing.assert_array_equal(item.motion.positions, found[name].motion.positions)
        assert item.annotations == found[name].annotations


def test_frame_ids_order_frames_of_one_time(tmp_path):
    truth = write_2d(tmp_path, ("oliver",), frames=180, intervals=1, audio=None)
    table = tmp_path / "frames_df_10_19_19.csv"
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    rows.sort(key=lambda row: int(row["frame_id"]))
    rows[101]["pose_dt"] = rows[100]["pose_dt"]
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(reversed(rows))
    first, second = (item for item in read_all(tmp_path) if isinstance(item, Recording))
    assert [len(first.motion), len(second.motion)] == [101, 78]
    points = np.delete(truth["oliver", "oliver:0"]["points"], [7, 8, 9], axis=2)
    assert (points[100] != points[101]).any()
    last = (points[100] - points[100, :, :1]) * [[1], [-1]]
    np.testing.assert_array_equal(first.motion.positions[-1], last.T)


def test_times():
    assert parse_time("00:01:29.389389") == pytest.approx(89.389389, abs=1e-9)
    assert parse_time("01:00:00") == 3600
    assert parse_time("0_02_47.367367") == pytest.approx(167.367367, abs=1e-9)
    assert parse_time("0 days 00:00:01.5") == parse_time("1900-01-01 00:00:01.5") == 1.5
    for text in ("", "12", "00:01", "a:b:c", "00:00:00.1234567890", "00:00:1e5"):
        with pytest.raises(ValueError, match="is no time"):
            parse_time(text)


def test_names_with_dots_and_colons():
    assert video_stem("2._History_of_x.vs._pH.mkv") == "2._History_of_x.vs._pH"
    assert video_stem("Ep. 3.mp4.webm") == "Ep. 3.mp4"
    assert video_stem("no_suffix.v2") == "no_suffix.v2"
    for value in (
        "/old/oliver/keypoints_simple/a.b/x_0_00_01.txt",
        "a.b/x_0_00_01.txt",
        "/other/a.b/x_0_00_01.txt",
        r"C:\d\keypoints_simple\a.b\x_0_00_01.txt",
    ):
        assert below(value, "keypoints_simple") == "a.b/x_0_00_01.txt"
    for value in ("", "/", "../x.txt", "a/../../x.txt", "/d/keypoints_simple/../../etc", "a\0b"):
        with pytest.raises(ValueError, match="is no path"):
            below(value, "keypoints_simple")
    assert recording_name("jon", "12_a.b") == "jon-12_a.b"
    assert recording_name("jon", "1:2") != recording_name("jon", "1_2")


def test_frame_rates():
    # The documented example: 116 frames span 7.741075 s.
    assert frame_rate(89.389389 + np.arange(117) * (7.741075 / 116)) == NTSC_FPS
    assert frame_rate(np.array([0.0, 1 / 15])) == 15
    times = np.arange(100) / 15
    times[50:] += 3  # a cut changes nothing
    assert frame_rate(np.round(times, 6)) == 15
    for rate, text in ((12.5, "12.500 fps"), (30, "30.000 fps")):
        with pytest.raises(ValueError, match=text):
            frame_rate(np.arange(10) / rate)
    with pytest.raises(ValueError, match="no two frames"):
        frame_rate(np.zeros(4))


def test_stretches():
    times = np.array([0, 1, 2, 2, 4, 5, 3, 4, 5, 6]) / 15
    stretches = [stretch.tolist() for stretch in split_at_gaps(times, 15.0)]
    assert stretches == [[0, 1, 2], [4, 5], [6, 7, 8, 9]]
    assert split_at_gaps(np.zeros(0), 15.0) == []
    lengths = [len(s) for s in split_at_gaps(np.arange(MAX_STRETCH_FRAMES + 5) / 15, 15.0)]
    assert lengths == [MAX_STRETCH_FRAMES, 5]


def test_gaps_split_an_interval(tmp_path):
    truth = write_2d(tmp_path, ("oliver",), frames=150, gaps={0: (70, 70), 1: (20, 30)})
    items = read_all(tmp_path)
    parts = [i for i in items if isinstance(i, Recording) and "oliver:0" in str(i.annotations)]
    assert [len(part.motion) for part in parts] == [70, 79]
    assert parts[1].id == parts[0].id + "-part2"
    start = truth["oliver", "oliver:0"]["times"][71]
    assert parts[1].annotations["start_s"] == pytest.approx(start, abs=1e-6)
    (short,) = [item for item in items if isinstance(item, Dropped)]
    assert (short.kind, short.is_fault) == ("short stretch", False)
    assert short.reason.startswith("20 frames")


@pytest.mark.parametrize("layout", ["intervals", "videos"])
def test_audio_is_cut_at_the_frames_times(tmp_path, layout):
    truth = write_2d(tmp_path, ("oliver",), frames=120, audio=layout, gaps={2: (5, 5)})
    items = by_interval(read_all(tmp_path))
    assert len(items) == 6
    for name, item in items.items():
        times = truth["oliver", name]["times"]
        start = times[6] if name == "oliver:2" else times[0]
        waveform = item.speech.waveform
        count = round(len(item.motion) / item.motion.fps * 16000)
        assert len(waveform) == count
        # The extracted files end with the last frame: zeros after it.
        last = int((times[-1] - start) * 16000) - 100
        expected = clock_sound(start + np.arange(count) / 16000)
        assert np.abs(waveform[100:last] - expected[100:last]).max() < 2e-3
        assert "warnings" not in item.annotations


def test_audio_before_and_after_the_file(tmp_path):
    truth = write_2d(tmp_path, ("oliver",), frames=70, intervals=1)
    (path,) = (tmp_path / "oliver" / "train" / "audio").iterdir()
    length = truth["oliver", "oliver:0"]["times"][-1]
    piece, found = read_audio(AudioFile(path, 10.0), 9.0, 3.0)
    assert (len(piece), found) == (48000, 32000)
    assert not piece[:16000].any()
    expected = clock_sound(np.arange(32000) / 16000)
    assert np.abs(piece[16100:47000] - expected[100:31000]).max() < 2e-3
    piece, found = read_audio(AudioFile(path, 0.0), length + 5, 1.0)
    assert (found, piece.any()) == (0, False)
    path.write_bytes(b"RIFF nonsense")
    kinds = {item.kind for item in read_all(tmp_path) if isinstance(item, Dropped)}
    assert kinds == {"broken audio"}
    assert len(by_interval(read_all(tmp_path))["oliver:0"].speech.waveform) == 0


def test_sets_without_audio_say_so_once_per_speaker(tmp_path):
    write_2d(tmp_path, ("jon",), frames=70, audio=None)
    items = read_all(tmp_path)
    (note,) = [item for item in items if isinstance(item, Dropped)]
    assert note.reason.startswith("6 of 6 intervals of jon have no audio: there is no jon/train/")
    assert not note.is_fault
    assert all(len(item.speech.waveform) == 0 for item in by_interval(items).values())


def test_missing_and_broken_keypoints_are_reported(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=150, intervals=3)
    files = (tmp_path / "oliver" / "keypoints_simple").glob("*/*.txt")
    files = sorted(files, key=lambda path: path.stem)  # in the order of time
    for number in (3, 4):
        files[number].unlink()
    files[150 + 149].write_text("# x\n1 2 3\n4 5 6\n")
    files[150 + 0].write_text("1 2\x00")
    items = read_all(tmp_path)
    missing, broken = [
        item for item in items if isinstance(item, Dropped) and item.kind != "short stretch"
    ]
    assert missing.reason.startswith("2 of 150; the first: no ")
    assert broken.reason.startswith("2 of 150; the first: ")
    assert "expected 2 rows of 49 or 52" in broken.reason
    assert missing.is_fault
    assert broken.is_fault
    found = by_interval(items)
    assert [len(found[f"oliver:{i}"].motion) for i in range(3)] == [145, 148, 150]


def test_keypoint_text():
    row = " ".join(map(str, range(52)))
    parsed = parse_keypoints(f"# nose\n\n{row}\n# eyes\n{row}.5\n".encode())
    assert parsed[0, :9].tolist() == [0, 1, 2, 3, 4, 5, 6, 10, 11]
    assert parsed[1, -1] == 51.5
    twice = f"{row}\n{row}"
    for text, message in (
        ("", "0 rows of no numbers"),
        ("1 2\n3 4", r"an array of shape \(2, 2\)"),
        (f"{twice}\n{row}", "3 rows of 52 and 52 and 52"),
        (twice.replace("51", "nan"), "NaN"),
        (twice.replace("51", "1e9"), "beyond 100,000 pixels"),
        (twice.replace("51", "x"), "could not convert"),
    ):
        with pytest.raises(ValueError, match=message):
            parse_keypoints(text.encode())


def test_published_windows():
    # range(0, n - 64, 5): the last start is at most n - 65.
    assert training_windows(65, 15.0).starts.tolist() == [0]
    assert training_windows(64, 15.0).starts.tolist() == []
    windows = training_windows(200, NTSC_FPS)
    assert windows.starts.tolist() == list(range(0, 136, 5))
    assert windows.audio_starts[1] == int(5 * 2002 / 30000 * 16000) == 5338
    assert training_windows(200, 15.0).audio_starts[3] == 16000
    assert (window_audio_samples(NTSC_FPS), window_audio_samples(15.0)) == (67267, 67200)


def test_random_windows_are_a_function_of_the_seed():
    lengths = {"b": 100, "a": 64, "short": 63}
    windows = random_windows(lengths, seed=3)
    assert windows == random_windows(dict(reversed(lengths.items())), seed=3)
    assert windows != random_windows(lengths, seed=4)
    assert len(windows) == 1000
    assert {name for name, _ in windows} == {"a", "b"}
    starts = np.bincount([start for name, start in windows if name == "b"])
    # Every start up to the last possible one is drawn, about 500 / 37 times each.
    assert len(starts) == 37
    assert starts.min() > 2
    with pytest.raises(CospeechError, match="none of 1 test"):
        random_windows({"short": 63}, seed=0)


def test_scale_factors_are_the_published_ones():
    found = scale_factors({name: px for name, (px, _) in PUBLISHED_SCALES.items()})
    for name, (px, scale) in PUBLISHED_SCALES.items():
        # The distances are given to 6 digits, so their ratios are good for 1e-5 of relative error.
        assert found[name] == pytest.approx(scale, rel=1e-5), name
        assert scale_factors({name: px})[name] == pytest.approx(JON_SHOULDER_PX / px)


def test_scale_factors_of_recordings_and_statistics(tmp_path):
    sizes = {"jon": 300.0, "rock": 120.0}
    write_2d(tmp_path, ("jon", "rock"), frames=70, shoulder_px=sizes, audio=None)
    items = [item for item in read_all(tmp_path) if isinstance(item, Recording)]
    assert {(i.speaker, i.annotations["scale_factor"]) for i in items} == {
        ("jon", 1),
        ("rock", 2.5),
    }
    statistics = speaker_statistics(items)
    distances = {name: s.shoulder_distance for name, s in statistics.items()}
    assert distances == pytest.approx(sizes)
    assert scale_factors(distances) == pytest.approx({"jon": 1, "rock": 2.5})


def test_statistics_in_one_pass_are_those_of_all_frames(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=90, audio=None)
    items = [i for i in read_all(tmp_path) if isinstance(i, Recording) and i.split == "train"]
    statistics = speaker_statistics(iter(items))["oliver"]
    everything = np.concatenate([item.motion.positions for item in items]).astype(float)
    assert statistics.count == len(everything) == 360
    # All x, then all y, and y down.
    flat = np.concatenate([everything[..., 0], -everything[..., 1]], axis=1)
    np.testing.assert_allclose(statistics.mean, flat.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(statistics.std, flat.std(axis=0), atol=1e-9)
    positions = items[0].motion.positions
    channels = statistics.normalise(positions)
    expected = (to_channels(positions) - statistics.mean) / (statistics.std + 2.2204e-16)
    np.testing.assert_allclose(channels, expected)
    moving = statistics.std > 0
    assert moving.sum() > 20
    wrist = BERKELEY_2D.index["left_wrist"]
    assert channels[7, 49 + wrist] == pytest.approx(
        (-positions[7, wrist, 1] - statistics.mean[49 + wrist]) / statistics.std[49 + wrist]
    )
    np.testing.assert_allclose(statistics.denormalise(channels), positions, atol=1e-4)
    twice = statistics.denormalise(channels, scale=2.0)
    np.testing.assert_allclose(twice, 2 * positions, atol=2e-4)
    channels[:, [0, 49]] = 7.0  # what a network says of the neck is not listened to
    np.testing.assert_allclose(statistics.denormalise(channels)[:, 0], 0.0)
    np.testing.assert_allclose(from_channels(to_channels(positions)), positions)


def test_samples_are_put_together_again(tmp_path):
    truth = write_2d(tmp_path / "full", ("oliver",), frames=120)
    (tmp_path / "extracted").mkdir()
    assert write_samples(tmp_path / "extracted", truth, columns=52) == 5 * 12
    full = by_interval(read_all(tmp_path / "full"))
    extracted = by_interval(read_all(tmp_path / "extracted"))
    assert extracted.keys() == {f"oliver:{i}" for i in range(5)}
    for name, item in extracted.items():
        # The last windows start at frame 55: one frame of the interval is in none.
        assert len(item.motion) == 119
        positions = full[name].motion.positions[:119]
        np.testing.assert_array_equal(item.motion.positions, positions)
        assert item.split == full[name].split
        assert item.motion.fps == NTSC_FPS
        count = int(118 / NTSC_FPS * 16000) - 20
        start = truth["oliver", name]["times"][0]
        expected = clock_sound(start + np.arange(count) / 16000)
        # The published cut is at whole samples.
        assert np.abs(item.speech.waveform[:count] - expected).max() < 0.05
        correlation = np.corrcoef(item.speech.waveform[:count], expected)[0, 1]
        assert correlation > 0.999
    files = sorted((tmp_path / "extracted" / "oliver" / "train" / "npz").iterdir())
    files[0].write_bytes(files[0].read_bytes()[:5000])
    objects = np.array([{}], dtype=object)
    np.savez(files[1], pose=objects, audio=np.zeros(3), imgs=objects)
    (note,) = [i for i in read_all(tmp_path / "extracted") if isinstance(i, Dropped)]
    assert note.kind == "broken samples"
    assert note.reason.startswith("2 of 12; the first: ")


def test_shares_cover_every_interval_once(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=66, intervals=12, audio=None)
    table = str(tmp_path / "frames_df_10_19_19.csv")
    names = [
        item.id
        for share in range(5)
        for item in read_intervals(str(tmp_path), "keypoints", table, "oliver", share, 5)
        if isinstance(item, Recording)
    ]
    assert len(names) == len(set(names)) == 12


# Tables that lie --------------------------------------------------------------------------------


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(CospeechError, match=r"none of the tables frames_df_10_19_19\.csv"):
        find_2d_sources(tmp_path)
    write_2d(tmp_path, ("oliver",), frames=66, audio=None)
    with pytest.raises(CospeechError, match=r"no keypoints of seth .* files of oliver"):
        find_2d_sources(tmp_path, speakers=["oliver", "seth"])
    with pytest.raises(CospeechError, match=r"folder above, where frames_df_10_19_19\.csv is"):
        find_2d_sources(tmp_path / "oliver")
    with pytest.raises(CospeechError, match="nowhere is not a folder"):
        find_2d_sources(tmp_path / "nowhere")
    (tmp_path / "seth" / "keypoints_simple").mkdir(parents=True)
    (source,) = find_2d_sources(tmp_path, speakers=["seth"])
    with pytest.raises(InputFileError, match="no row of the speaker seth"):
        list(source.read())


def rewrite(path, change):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(change(rows))


def test_columns_are_found_by_name(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=66, audio=None)
    before = by_interval(read_all(tmp_path))
    table = tmp_path / "frames_df_10_19_19.csv"
    # pandas' index column, other order, a byte-order mark, quotes, absolute paths of elsewhere.
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row["pose_fn"] = "/old/machine/oliver/keypoints_simple/" + row["pose_fn"]
        row["video_link"] = 'a, "quoted"\nlink'
    names = ["", *reversed(rows[0])]
    with table.open("w", newline="", encoding="utf-8-sig") as file:
        writer = csv.DictWriter(file, names, quoting=csv.QUOTE_ALL)
        writer.writeheader()
        writer.writerows(row | {"": i} for i, row in enumerate(rows))
    after = by_interval(read_all(tmp_path))
    assert before.keys() == after.keys()
    for name, item in before.items():
        np.testing.assert_array_equal(item.motion.positions, after[name].motion.positions)
    assert after["oliver:0"].annotations["link"] == 'a, "quoted"\nlink'
    rewrite(table, lambda rows: [row[:3] for row in rows])
    with pytest.raises(InputFileError, match=r"line 1: has the columns .*are missing"):
        read_all(tmp_path)


def test_wild_rows(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=100, intervals=1, audio=None)
    table = tmp_path / "frames_df_10_19_19.csv"
    data = table.read_bytes().splitlines(keepends=True)
    good = data[50]
    wild = [
        b"too,few\n",
        b'a stray " quote' + good,
        good.replace(b"00:00:0", b"late:"),
        good.replace(b"2._History", b"../../../etc/passwd"),
        b'"never closed' + b"x" * 100_000 + b"\n",
        b"x" * 200_000 + b"\n",
        b"\n",
        b"\0" * 50 + b"\n",
    ]
    table.write_bytes(b"".join([*data[:60], *wild, *data[60:]]))
    items = read_all(tmp_path)
    assert len(by_interval(items)["oliver:0"].motion) == 100
    reasons = [item.reason for item in items if isinstance(item, Dropped) and item.is_fault]
    # Two rows of the interval have no time or path; pieces of the others count as rows.
    assert len(reasons) == 2
    assert reasons[0].startswith("9 rows of ")
    assert reasons[0].endswith("the first is line 61")
    assert reasons[1].startswith("2 of 102; the first: 'late:")


def test_a_table_of_another_kind(tmp_path):
    write_2d(tmp_path, ("oliver",), frames=66, audio=None)
    table = tmp_path / "frames_df_10_19_19.csv"
    for content in (b"", b"\0" * 1000, b"speaker,speaker\n", b"\x80\x04pickle" * 100, b'"' * 70000):
        table.write_bytes(content)
        with pytest.raises(InputFileError, match=r"frames_df_10_19_19\.csv"):
            read_all(tmp_path)


@pytest.fixture(scope="module")
def small_set(tmp_path_factory):
    folder = tmp_path_factory.mktemp("berkeley")
    write_2d(folder, ("oliver",), frames=66, intervals=2, audio=None)
    return folder


@settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(
    edits=st.lists(
        st.tuples(
            st.floats(0, 1, exclude_max=True),
            st.sampled_from([b'"', b",", b"\n", b"\0", b"\xff", b"9" * 30, b":", b"..", b"/"]),
        ),
        min_size=1,
        max_size=8,
    )
)
def test_mutated_tables_raise_only_documented_errors(small_set, edits):
    table = small_set / "frames_df_10_19_19.csv"
    original = small_set / "original"
    if not original.exists():
        original.write_bytes(table.read_bytes())
    data = original.read_bytes()
    for where, what in edits:
        place = int(where * len(data))
        data = data[:place] + what + data[place + len(what) :]
    table.write_bytes(data)
    problem = table.name
    try:
        items = read_all(small_set)
    except InputFileError as error:
        items, problem = [], str(error)
    assert table.name in problem
    assert all(isinstance(item, Recording | Dropped) for item in items)


def test_memory_of_the_table_is_bounded(tmp_path):
    """Forty thousand rows: kilobytes in order, 16 bytes a row and growth when shuffled."""
    header = "frame_id,pose_dt,pose_fn,speaker,video_fn,interval_id,dataset\n"
    rows = [
        f"{i},{stamp(i / 15)},v/{i}.txt,oliver,v.mp4,i{i // 500},train\n" for i in range(40_000)
    ]
    peaks = []
    for order in (np.arange(len(rows)), np.random.default_rng(0).permutation(len(rows))):
        path = tmp_path / f"frames{len(peaks)}.csv"
        path.write_text(header + "".join(rows[i] for i in order))
        tracemalloc.start()
        index = index_rows(path, ("speaker", "interval_id"))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(index.runs) == 80
        found = index.rows(("oliver", "i7"), ("frame_id",))
        assert sorted(int(number) for (number,) in found) == list(range(3500, 4000))
    assert peaks[0] < 200_000
    assert peaks[1] < 40_000 * 16 * 1.3 + 200_000


# The data module --------------------------------------------------------------------------------


def test_a_store_of_the_2d_set(tmp_path):
    write_2d(tmp_path / "raw", frames=100)
    data = BerkeleyData(
        store_dir=str(tmp_path / "stores"), batch_size=4, seed=0, split="published",
        val_share=0.1, test_share=0.1, split_seed=0, strict=True, max_recordings=None,
        root=str(tmp_path / "raw"), kind="auto", speakers=["oliver", "seth"], chunks="matching",
    )  # fmt: skip
    assert (data.kind, data.corpus_name, data.upper_body) == ("2d", "berkeley2d", False)
    store = data.prepare_store()
    assert [len(store.splits[split]) for split in ("train", "val", "test")] == [8, 2, 2]
    assert store.dimensions == 2
    # 100 frames: starts 0 to 35 in steps of 5.
    windows = WindowDataset(store, "train", WindowSpec(15.0, 64, 0, 5), frozenset({"audio"}))
    assert len(windows) == 8 * 8
    batch = windows.batch([1])
    recording = store.recordings[windows.recordings[1]]
    item = by_interval(read_all(tmp_path / "raw", speakers=[recording.speaker]))
    waveform = next(i for i in item.values() if i.id == recording.id).speech.waveform
    expected = waveform[5338 : 5338 + 68267]
    np.testing.assert_allclose(batch.audio[0, : len(expected)], expected, atol=1 / 32768)


def test_sound_takes_memory_for_what_is_asked_and_not_for_what_lies_between_its_pieces():
    pieces = [(0.0, np.full(4, 1.0, np.float32)), (1e9, np.full(4, 2.0, np.float32))]
    np.testing.assert_array_equal(sound_of(pieces, 0.0, 6 / 16000), [1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(sound_of(pieces, 1e9 - 2 / 16000, 4 / 16000), [0, 0, 2, 2])
    np.testing.assert_array_equal(sound_of(pieces, 1e9 + 2 / 16000, 4 / 16000), [2, 2, 0, 0])
