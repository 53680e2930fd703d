"""The corpus report against numbers counted plainly, on stores with and without everything."""

import dataclasses
import itertools
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from cospeech.corpus.packing import pack_source
from cospeech.corpus.recording import Recording, WindowList
from cospeech.corpus.source import Dropped, Source
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASE_INDEX
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.corpus_report import write_corpus_report
from cospeech.reporting.corpus_report.charts import counts_in, round_edges
from cospeech.reporting.corpus_report.statistics import (
    MOST_FRAMES,
    corpus_statistics,
    window_starts,
)
from cospeech.reporting.corpus_report.streaming import SPEED_EDGES, StreamingHistogram, evenly
from cospeech.reporting.corpus_report.unusual import fences, measures, unusual
from cospeech.reporting.corpus_report.windows import choose_windows, draw_window
from cospeech.speech.speech import Speech, Word
from tests.corpora import make_recording, make_store
from tests.reporting.drawn import drawn

HOSTILE = '</td><script>alert("1")</script>&'


def store_of(folder, recordings, dropped=(), name="made", upper_body=True):
    """All but the last two train, those validate and test."""
    parameters = {"root": "somewhere"}
    with StoreWriter(folder / "s", name, parameters, "0" * 64, upper_body=upper_body) as writer:
        source = Source("all", lambda: [*recordings, *dropped], ())
        writer.append(pack_source(source, upper_body))
        frames = writer.columns()["frames"]
        names = ["train"] * (len(frames) - 2) + ["val", "test"]
        return writer.finish(
            {
                split: [Span(i, 0, frames[i]) for i in range(len(frames)) if names[i] == split]
                for split in ("train", "val", "test")
            }
        )


def page_of(store, tmp_path, seed=0):
    write_corpus_report(store, tmp_path / "page.html", seed)
    return (tmp_path / "page.html").read_text(encoding="utf-8")


class _Tags(HTMLParser):
    """Tags in order, and whether every one is closed."""

    VOID = ("meta", "br")

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.open = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


# Streaming ------------------------------------------------------------------------------------


def test_streamed_quantiles_and_means_equal_those_of_all_numbers_at_once():
    rng = np.random.default_rng(0)
    values = rng.lognormal(-1, 1.5, (5000, 3)) * [1, 10, 100]
    histogram = StreamingHistogram(SPEED_EDGES, 3)
    for part in np.array_split(values, 7):
        histogram.add(part)
    np.testing.assert_allclose(histogram.mean, values.mean(axis=0))
    for share in (0.05, 0.5, 0.95):
        expected = np.quantile(values, share, axis=0)
        np.testing.assert_allclose(histogram.quantile(share), expected, rtol=0.012)


def test_coarser_bins_hold_the_same_numbers():
    histogram = StreamingHistogram(np.linspace(0, 10, 101))
    values = np.array([-1.0, 0.05, 0.95, 1.05, 4.5, 9.95, 10.0, 12.0])
    histogram.add(values[:, None])
    # the number on the last edge is outside, as one past it
    np.testing.assert_allclose(
        histogram.rebinned(np.array([0.0, 1.0, 5.0, 10.0]))[0], [1, 2, 2, 1, 2], atol=1e-9
    )


def test_nothing_added_is_no_number():
    histogram = StreamingHistogram(np.linspace(0, 1, 3))
    assert np.isnan(histogram.mean).all()
    assert np.isnan(histogram.quantile(0.5)).all()


def test_even_subsample_keeps_the_ends():
    assert list(evenly(4, 9)) == [0, 1, 2, 3]
    assert list(evenly(11, 3)) == [0, 5, 10]


@pytest.mark.parametrize(("low", "high"), [(0, 37.2), (18.1, 21.9), (-95, -20), (0.0013, 0.0017)])
def test_bins_are_round_and_cover_the_numbers(low, high):
    edges = round_edges(low, high)
    widths = np.diff(edges)
    assert edges[0] <= low + 1e-9
    assert edges[-1] >= high - 1e-9
    assert 8 <= len(widths) <= 33
    mantissa = widths[0] / 10 ** np.floor(np.log10(widths[0]) + 1e-9)
    assert min(abs(mantissa - m) for m in (1, 2, 5)) < 1e-6
    assert counts_in(np.array([low, high, np.nan]), edges)[1:-1].sum() == 2


# Statistics -----------------------------------------------------------------------------------


def test_per_recording_numbers_equal_a_plain_count(tmp_path):
    store = make_store(tmp_path)
    statistics = corpus_statistics(store)
    for i in range(len(store.recordings)):
        wrists = np.array(store.upper_body(i)[:, [6, 9]], dtype=np.float64)
        speeds = [
            [np.sqrt(((b - a) ** 2).sum()) * 15 for a, b in itertools.pairwise(w)]
            for w in (wrists[:, 0], wrists[:, 1])
        ]
        assert statistics.measures["seconds"][i] == pytest.approx(10.0)
        assert statistics.measures["words_per_minute"][i] == len(store.words(i)) * 6
        assert statistics.measures["left_wrist"][i] == pytest.approx(np.mean(speeds[0]))
        assert statistics.measures["right_wrist"][i] == pytest.approx(np.mean(speeds[1]))
        audio = store.read(i, "audio")[:, 0] / 32767
        level = 10 * np.log10(np.mean(audio**2))
        assert statistics.measures["level"][i] == pytest.approx(level, abs=1e-3)
        assert statistics.measures["excess_audio"][i] == pytest.approx(0.0)
        assert statistics.measures["clipped"][i] == 0.0


def test_totals_equal_a_plain_count(tmp_path):
    store = make_store(tmp_path)
    statistics = corpus_statistics(store)
    train = statistics.splits[0]
    words = len(store.words(0))
    assert (train.name, train.recordings, train.speakers) == ("train", 4, 2)
    assert train.hours == pytest.approx(4 * 10 / 3600)
    assert train.words == 4 * words
    assert train.words_per_minute == pytest.approx(words * 6)
    # frames 0 to 149: windows of 34 begin at 0, 10, ... 110
    assert train.windows == 4 * 12
    assert (statistics.total.words, statistics.total.windows) == (6 * words, 6 * 12)
    by_hand = np.bincount(
        np.concatenate([store.words(i)[:, 2] for i in range(6)]).astype(int),
        minlength=len(store.vocabulary),
    )
    np.testing.assert_array_equal(statistics.word_counts, by_hand)
    assert statistics.word_seconds.mean[0] == pytest.approx(0.3)


def test_words_of_time_blocks_belong_to_the_block_they_begin_in(tmp_path):
    recording = make_recording(
        "one", words=(Word("a", 0.0, 1.0), Word("b", 4.9, 5.5), Word("c", 5.0, 5.2))
    )
    with StoreWriter(tmp_path / "s", "made", {}, "0" * 64) as writer:
        writer.add(recording)
        store = writer.finish({"train": [Span(0, 0, 75)], "val": [Span(0, 75, 150)], "test": []})
    train, val, test = corpus_statistics(store).splits
    assert (train.words, val.words, test.words) == (2, 1, 0)
    assert np.isnan(test.words_per_minute)
    assert train.hours * 3600 == pytest.approx(5.0)


def test_speakers_pool_their_recordings(tmp_path):
    recordings = [
        make_recording("a", "ada", 10.0, seed=0),
        make_recording("b", "ben", 30.0, seed=1),
        make_recording("c", "ada", 40.0, seed=2),
    ]
    recordings[0] = dataclasses.replace(
        recordings[0], speech=Speech(recordings[0].speech.waveform, None)
    )
    store = store_of(tmp_path, recordings)
    ada, ben = corpus_statistics(store).speakers
    assert (ada.name, ada.splits, ada.recordings) == ("ada", ("train", "test"), 2)
    assert ben.splits == ("val",)
    assert ada.minutes == pytest.approx(50 / 60)
    # the recording without a transcript counts neither words nor minutes
    assert ada.words_per_minute == pytest.approx(len(store.words(2)) / (40 / 60))
    left = [
        np.linalg.norm(np.diff(store.upper_body(i)[:, 6].astype(float), axis=0), axis=1) * 15
        for i in (0, 2)
    ]
    assert ada.wrist_speeds[0] == pytest.approx(np.concatenate(left).mean())


def test_joint_speeds_and_bones_equal_a_plain_count(tmp_path):
    rng = np.random.default_rng(3)
    recordings = []
    for i, fps in enumerate((15.0, 15.0, 60.0)):
        base = make_recording(f"r{i}", seconds=12.0, seed=i)
        positions = np.repeat(base.motion.positions, round(fps / 15), axis=0) * (1 + 0.1 * i)
        positions = positions + rng.normal(0, 0.004, positions.shape).astype(np.float32)
        recordings.append(
            dataclasses.replace(base, motion=Motion(UPPER_BODY, fps, positions.astype(np.float32)))
        )
    store = store_of(tmp_path, recordings)
    joints = corpus_statistics(store).joints[0]
    speeds, lengths = [], []
    for i, step in enumerate((1, 1, 4)):
        motion = store.motion(i)
        positions = motion.positions.astype(np.float64)
        # one look every 1/15 s, whatever the frame rate
        firsts = np.arange((len(positions) - 1) // step) * step
        moved = np.linalg.norm(positions[firsts + step] - positions[firsts], axis=2)
        speeds.append(moved * motion.fps / step)
        bones = positions[firsts, 1:] - positions[firsts][:, list(UPPER_BODY.parents[1:])]
        lengths.append(np.linalg.norm(bones, axis=2))
    everything = np.concatenate(speeds)
    np.testing.assert_allclose(joints.speeds.mean, everything.mean(axis=0))
    for share in (0.5, 0.95):
        np.testing.assert_allclose(
            joints.speeds.quantile(share), np.quantile(everything, share, axis=0), rtol=0.02
        )
    pooled = np.concatenate(lengths)
    mean = pooled.mean(axis=0)
    np.testing.assert_allclose(joints.bone_lengths[1:], mean)
    total = np.hypot(joints.bone_variation_within, joints.bone_variation_between)[1:]
    np.testing.assert_allclose(total, pooled.std(axis=0) / mean)
    within = np.sqrt(np.mean([own.var(axis=0) for own in lengths], axis=0)) / mean
    # weights are frames, and the three recordings have nearly the same number
    np.testing.assert_allclose(joints.bone_variation_within[1:], within, rtol=1e-3)
    assert joints.bone_lengths[0] == 0


def test_long_recordings_are_looked_at_evenly(tmp_path):
    seconds = (MOST_FRAMES + 2000) / 15
    recordings = [make_recording(f"r{i}", seconds=seconds, words=(), seed=i) for i in range(3)]
    joints = corpus_statistics(store_of(tmp_path, recordings)).joints[0]
    assert joints.frames == 3 * MOST_FRAMES
    speeds = [
        np.linalg.norm(np.diff(r.motion.positions.astype(float), axis=0), axis=2) * 15
        for r in recordings
    ]
    expected = np.quantile(np.concatenate(speeds), 0.5, axis=0)
    np.testing.assert_allclose(joints.speeds.quantile(0.5)[[6, 9]], expected[[6, 9]], rtol=0.03)


def test_wrist_map_counts_every_frame_where_it_is(tmp_path):
    store = make_store(tmp_path)
    hands = corpus_statistics(store).hands
    assert hands.frames == 6 * 150
    np.testing.assert_array_equal(hands.counts.sum(axis=(1, 2)), [900, 900])
    everything = np.concatenate([store.upper_body(i) for i in range(6)]).astype(float)
    np.testing.assert_allclose(hands.pose_sum / hands.pose_frames, everything.mean(axis=0))
    x, y = np.argwhere(hands.counts[0]).min(axis=0)
    low = everything[:, 6, :2].min(axis=0)
    np.testing.assert_array_equal([x, y], np.floor((low - hands.origin) / hands.cell))


def test_published_windows_are_the_ones_counted(tmp_path):
    starts = np.array([0, 10, 60, 120])
    lists = WindowList(15.0, 42, 10, starts, starts * 16000 // 15, {"too little motion": 7})
    recordings = [
        dataclasses.replace(make_recording(f"r{i}", seed=i), windows=lists) for i in range(3)
    ]
    store = store_of(tmp_path, recordings)
    # the one from frame 120 would end past frame 150
    assert list(window_starts(store, Span(0, 0, 150))) == [0, 10, 60]
    assert list(window_starts(store, Span(0, 5, 150))) == [10, 60]
    statistics = corpus_statistics(store)
    assert statistics.total.windows == 9
    page = page_of(store, tmp_path)
    assert "too little motion" in page
    # 3 recordings dropped 7 each and kept 3 each
    assert re.search(r"too little motion</td><td[^>]*>21</td><td[^>]*>70\.0 %", page)


# What stands apart ----------------------------------------------------------------------------


def test_numbers_far_from_the_rest_are_found_with_their_recording(tmp_path):
    recordings = [make_recording(f"take{i}", seconds=10.0 + i % 3, seed=i) for i in range(12)]
    fast = tuple(Word("word", 0.1 * k, 0.1 * k + 0.05) for k in range(100))
    recordings[4] = make_recording("chatter", words=fast, seed=4)
    still = recordings[7].motion.positions.copy()
    still[:] = still[:1]
    recordings[7] = dataclasses.replace(
        recordings[7], id="statue", motion=Motion(UPPER_BODY, 15.0, still)
    )
    silent = Speech(np.zeros(160_000, np.float32), recordings[8].speech.words)
    recordings[8] = dataclasses.replace(recordings[8], id="mute", speech=silent)
    store = store_of(tmp_path, recordings)
    statistics = corpus_statistics(store)
    found = {(one.recording, one.measure.key) for one in unusual(statistics.measures, 3)}
    assert (4, "words_per_minute") in found
    assert {(7, "left_wrist"), (7, "right_wrist"), (7, "still")} <= found
    assert (8, "level") in found
    assert {recording for recording, _ in found} == {4, 7, 8}
    page = page_of(store, tmp_path)
    for name in ("chatter", "statue", "mute"):
        assert f"<code>{name}</code>" in page


def test_fences_are_three_quartile_ranges_out():
    measure = next(m for m in measures(3) if m.key == "words_per_minute")
    values = np.arange(100.0, 201.0, 5.0)
    found = fences(measure, values)
    assert found.quartiles == (125.0, 175.0)
    assert found.bounds == (-25.0, 325.0)
    assert fences(measure, values[:7]) is None


def test_near_equal_recordings_have_none_that_stands_apart(tmp_path):
    values = {m.key: np.full(20, np.nan) for m in measures(3)}
    values["level"] = np.full(20, -20.0)
    values["level"][3] = -20.8
    assert unusual(values, 3) == []
    values["level"][3] = -24.0
    assert [(one.recording, one.measure.key) for one in unusual(values, 3)] == [(3, "level")]


# Drawn windows --------------------------------------------------------------------------------


def test_windows_are_drawn_by_the_seed_from_the_whole_list(tmp_path):
    store = make_store(tmp_path)
    drawn = choose_windows(store, 10, seed=5)
    assert drawn == choose_windows(store, 10, seed=5)
    assert drawn != choose_windows(store, 10, seed=6)
    everything = choose_windows(store, 1000, seed=0)
    expected = [
        (name, Span(span.recording, start, start + 34))
        for name, spans in store.splits.items()
        for span in spans
        for start in range(0, 117, 10)
    ]
    assert everything == expected
    assert set(drawn) <= set(expected)


def test_fragments_too_short_for_a_window_are_drawn_whole(tmp_path):
    recordings = [make_recording(f"r{i}", seconds=1.0, words=(), seed=i) for i in range(3)]
    store = store_of(tmp_path, recordings)
    assert [span for _, span in choose_windows(store, 10, 0)] == [Span(i, 0, 15) for i in range(3)]
    assert page_of(store, tmp_path).count('class="window"') == 3


def test_words_and_phases_of_a_drawn_window_stand_at_their_time(tmp_path):
    words = (Word("a", 0.0, 1.0), Word("long", 1.0, 1.5), Word("gone", 5.0, 6.0))
    phases = np.repeat([PHASE_INDEX["stroke"], PHASE_INDEX["hold"]], [15, 135]).astype(np.int8)
    recordings = [
        dataclasses.replace(make_recording(f"r{i}", words=words, seed=i), phases=phases)
        for i in range(3)
    ]
    store = store_of(tmp_path, recordings)
    found = dict(drawn(draw_window(store, Span(0, 0, 34), 100.0)))
    sides = {
        title: (min(x for x, _ in corners), max(x for x, _ in corners))
        for title, (corners,) in found.items()
    }
    assert set(sides) == {"a: 0.00 to 1.00 s", "long: 1.00 to 1.50 s", "stroke", "hold"}
    start, end = sides["a: 0.00 to 1.00 s"]
    assert sides["hold"][1] - start == pytest.approx((end - start) * 34 / 15, abs=0.2)
    assert sides["long: 1.00 to 1.50 s"] == pytest.approx((end, end + (end - start) / 2), abs=0.2)
    assert sides["stroke"] == pytest.approx((start, end), abs=0.2)


def test_a_joint_that_leaps_is_not_drawn_over_another_view(tmp_path):
    recordings = [make_recording(f"r{i}", seed=i) for i in range(3)]
    leaping = recordings[0].motion.positions.copy()
    leaping[19, 6] += 50  # in the fifth of the eight figures
    recordings[0] = dataclasses.replace(recordings[0], motion=Motion(UPPER_BODY, 15.0, leaping))
    chart = draw_window(store_of(tmp_path, recordings), Span(0, 0, 34), 100.0)
    left_arms = re.findall(r'd="([^"]*)" style="[^"]*stroke: #f0883e', chart)
    heights = [[float(y) for y in re.findall(r"[-.\d]+ ([-.\d]+)", line)] for line in left_arms]
    front, side = heights[: len(heights) // 2], heights[len(heights) // 2 :]
    assert max(map(max, front)) < min(map(min, side))


# The page -------------------------------------------------------------------------------------


def test_page_stands_alone_and_is_well_formed(tmp_path):
    page = page_of(make_store(tmp_path), tmp_path)
    parsed = _Tags(page)
    assert parsed.open == []
    assert not {"script", "link", "img", "iframe", "object", "image"} & set(parsed.tags)
    assert all(name != "src" for name, _ in parsed.attributes)
    assert all(value.startswith("#") for name, value in parsed.attributes if name == "href")
    assert not re.search(r"https?:|url\(|@import", page)
    assert "nan" not in re.sub(r"<[^>]*>", " ", page).lower().split()
    assert page.count('class="window"') == 10


def test_page_is_the_same_for_the_same_seed(tmp_path):
    store = make_store(tmp_path)
    assert page_of(store, tmp_path, 1) == page_of(store, tmp_path, 1)
    assert page_of(store, tmp_path, 1) != page_of(store, tmp_path, 2)


def test_hostile_names_and_words_stay_text(tmp_path):
    words = tuple(Word(f"<i>w{HOSTILE}", k, k + 0.5) for k in range(9))
    recordings = [
        dataclasses.replace(
            make_recording(f"{i}{HOSTILE}", f"s{HOSTILE}", words=words, seed=i),
            licence=HOSTILE,
            source=HOSTILE,
        )
        for i in range(9)
    ]
    names = tuple(f"{joint}{HOSTILE}" for joint in UPPER_BODY.joints)
    skeleton = Skeleton(f"k{HOSTILE}", names, UPPER_BODY.parents)
    recordings = [
        dataclasses.replace(r, motion=Motion(skeleton, 15.0, r.motion.positions))
        for r in recordings
    ]
    recordings[2] = dataclasses.replace(recordings[2], speech=Speech(np.zeros(0, np.float32), ()))
    dropped = [Dropped(f"d{HOSTILE}", f"r{HOSTILE}", f"kind{HOSTILE}")]
    store = store_of(tmp_path, recordings, dropped, name=f"n{HOSTILE}", upper_body=False)
    page = page_of(store, tmp_path)
    assert "<script" not in page
    assert _Tags(page).open == []
    for start in ("0", "s", "k", "d", "r", "kind", "n"):
        assert f"{start}&lt;/td&gt;&lt;script&gt;" in page, start


def test_what_was_dropped_is_counted_by_reason(tmp_path):
    dropped = [Dropped(f"clip{i}", f"reason {i}", "no words") for i in range(3)]
    dropped.append(Dropped("bad", "NaN at frame 7", "damaged", is_fault=True))
    recordings = [make_recording(f"r{i}", seed=i) for i in range(4)]
    page = page_of(store_of(tmp_path, recordings, dropped), tmp_path)
    assert re.search(r"kept</td><td[^>]*>4</td><td[^>]*>50\.0 %", page)
    assert re.search(r"no words</td><td[^>]*>3</td><td[^>]*>37\.5 %", page)
    assert re.search(
        r"fault: damaged</td><td[^>]*><span class=.flag.>1</span></td><td[^>]*>12\.5 %", page
    )
    # faults first
    assert page.index("<code>bad</code>: NaN at frame 7") < page.index("<code>clip0</code>")


def keypoints(frames=120, seed=0):
    rng = np.random.default_rng(seed)
    rest = 200 * np.array(make_recording("x").motion.positions[0, :, :2]) + 300
    steps = rng.normal(0, 2, (frames, 10, 2))
    return Motion(UPPER_BODY, 15.0, (rest + steps).astype(np.float32))


def test_two_dimensional_keypoints_without_words(tmp_path):
    speech = Speech(make_recording("x", seconds=8.0).speech.waveform, None)
    recordings = [Recording(f"r{i}", "ada", speech, keypoints(seed=i)) for i in range(4)]
    store = store_of(tmp_path, recordings, upper_body=False)
    statistics = corpus_statistics(store)
    moved = np.diff(np.stack([r.motion.positions for r in recordings]).astype(float), axis=1)
    speeds = np.linalg.norm(moved, axis=-1) * 15
    np.testing.assert_allclose(statistics.wrists.mean, speeds[:, :, [6, 9]].mean(axis=(0, 1)))
    assert statistics.hands is None
    assert np.isnan(statistics.measures["words_per_minute"]).all()
    page = page_of(store, tmp_path)
    for said in ("2-D keypoints", "px/s", "no transcript", "No recording has gesture phases"):
        assert said in page
    assert ">side<" not in page
    assert "cm/s</th>" not in page


def test_few_joints_and_phases_without_sound(tmp_path):
    joints = ("spine", "head", "left_hand", "right_hand", "left_wrist", "right_wrist")
    skeleton = Skeleton("six", joints, (-1, 0, 0, 0, 2, 3))
    rng = np.random.default_rng(0)
    phases = np.repeat([PHASE_INDEX["rest_hold"], PHASE_INDEX["stroke"]], [30, 90]).astype(np.int8)
    recordings = [
        Recording(
            f"a{i}",
            "a",
            Speech(np.zeros(0, np.float32), None),
            Motion(skeleton, 20.0, rng.normal(0, 0.3, (120, 6, 3)).astype(np.float32)),
            phases=phases,
        )
        for i in range(3)
    ]
    store = store_of(tmp_path, recordings, upper_body=False)
    statistics = corpus_statistics(store)
    assert statistics.phase_frames[PHASE_INDEX["stroke"]] == 270
    assert statistics.phase_recordings == 3
    page = page_of(store, tmp_path)
    for said in ("25.0 %", "75.0 %", "no audio", "the corpus has no audio", "rest hold"):
        assert said in page


def test_corpus_of_one_frame_recordings_has_a_page(tmp_path):
    rest = make_recording("x").motion.positions[:1]
    recordings = [
        Recording(
            f"r{i}", "a", Speech(np.zeros(0, np.float32), None), Motion(UPPER_BODY, 15.0, rest)
        )
        for i in range(3)
    ]
    page = page_of(store_of(tmp_path, recordings), tmp_path)
    assert _Tags(page).open == []
    assert "not known" in page


def test_page_replaces_the_old_one_only_when_complete(tmp_path, monkeypatch):
    store = make_store(tmp_path)
    target = tmp_path / "page.html"
    target.write_text("old")

    def fail(*_):
        raise OSError("unreadable")

    monkeypatch.setattr(Store, "motion", fail)
    with pytest.raises(OSError, match="unreadable"):
        write_corpus_report(store, target)
    assert target.read_text() == "old"
