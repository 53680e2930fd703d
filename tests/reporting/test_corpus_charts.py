"""Histograms, bars and the map of the hands: each number where it belongs."""

from xml.etree import ElementTree

import numpy as np
import pytest

from cospeech.reporting.charts import colour
from cospeech.reporting.corpus_report.charts import (
    Series,
    hand_space,
    histogram,
    length_bar,
    range_bar,
)
from cospeech.reporting.corpus_report.totals import HandSpace
from tests.corpora import REST_POSE
from tests.reporting.drawn import drawn, texts


def box(corners):
    """Left, right, width and height."""
    xs, ys = zip(*corners, strict=True)
    return min(xs), max(xs), np.ptp(xs), np.ptp(ys)


def test_a_bar_is_as_high_as_its_count_and_says_it():
    counts = np.array([0, 10, 40, 20, 0])
    chart = histogram([Series("", colour("bar"), counts)], np.arange(4.0), "s", "words", 1.5)
    bars = {title: box(paths[0]) for title, paths in drawn(chart)}
    assert list(bars) == ["0 to 1 s: 10 words", "1 to 2 s: 40 words", "2 to 3 s: 20 words"]
    first, second, third = bars.values()
    assert [second[3] / first[3], second[3] / third[3]] == pytest.approx([4, 2], rel=0.01)
    assert second[0] - first[0] == pytest.approx(third[0] - second[0], abs=0.11)
    assert {"0", "1", "2", "3", "s", "tallest bar: 40 words"} <= set(texts(chart))
    # the median is in the middle of the middle bar
    (median,) = (
        path.get("d")
        for path in ElementTree.fromstring(chart).iter("path")
        if "dasharray" in path.get("style")
    )
    middle = (second[0] + second[1]) / 2
    assert float(median[1:].split()[0]) == pytest.approx(middle, abs=1.5)


def test_what_is_outside_has_a_bar_and_a_sign_of_its_own_and_a_mark():
    counts = np.array([3, 10, 10, 1])
    marks = [(-50.0, "one <b>: -50 s"), (99.0, "two: 99 s")]
    chart = histogram(
        [Series("", colour("bar"), counts)], np.array([0.0, 1.0, 2.0]), "s", "words", marks=marks
    )
    places = {title: box(paths[-1]) for title, paths in drawn(chart)}
    assert [title for title in places if title.startswith(("under", "over"))] == [
        "under 0 s: 3 words",
        "over 2 s: 1 words",
    ]
    assert {"<", ">"} <= set(texts(chart))
    for mark, bar in (("one <b>: -50 s", "under 0 s: 3 words"), ("two: 99 s", "over 2 s: 1 words")):
        assert places[bar][0] < places[mark][0] < places[bar][1]


def test_equal_factors_take_equal_room_and_the_tallest_of_one_is_singular():
    edges = np.logspace(-1, 2, 31)
    sides = [
        Series("left: ", "#f0883e", np.eye(32)[1]),
        Series("right: ", "#3f8efc", np.eye(32)[30]),
    ]
    chart = histogram(sides, edges, "cm/s", "frames", logarithmic=True)
    ticks = {
        element.text: float(element.get("x"))
        for element in ElementTree.fromstring(chart).iter("text")
        if element.text in ("0.1", "1", "10", "100")
    }
    assert np.diff(list(ticks.values())) == pytest.approx([332 / 3] * 3, abs=0.2)
    assert "tallest bar: 1 frame" in texts(chart)
    assert [title.split(":")[0] for title, _ in drawn(chart)] == ["left", "right"]


def test_a_rare_value_beside_many_is_still_seen():
    counts = np.array([0, 1, 1_000_000, 0])
    chart = histogram([Series("", colour("bar"), counts)], np.array([0.0, 1.0, 2.0]), "s", "words")
    assert box(drawn(chart)[0][1][0])[3] >= 0.6


def test_wrists_are_where_they_were_and_stronger_where_more_often():
    counts = np.zeros((2, 88, 88), dtype=np.int64)
    counts[0, 50, 40], counts[0, 60, 40], counts[1, 30, 40] = 100, 25, 9
    hands = HandSpace(counts, 10 * REST_POSE.astype(np.float64), 10, 10)
    chart = ElementTree.fromstring(hand_space(hands))
    squares = {
        (path.get("d").split("L")[0], path.get("style"))
        for path in chart.iter("path")
        if "#f0883e" in path.get("style") and not path.get("id")
    }
    at = sorted((float(d[1:].split()[0]), style.split("opacity: ")[1]) for d, style in squares)
    # ten cells of 2.5 cm at 300 pixels per metre; the square root of a quarter
    assert at[1][0] - at[0][0] == pytest.approx(75, abs=0.11)
    assert [float(style.split(";")[0]) for _, style in at] == pytest.approx([0.8, 0.4])
    assert hand_space(HandSpace(np.zeros_like(counts))) == ""


def test_bars_of_tables_are_as_long_as_their_shares():
    assert 'style="width: 25.0%"' in length_bar(0.25)
    bar = range_bar(1.0, 3.0, 4.0, "left")
    assert '<i class="left" style="width: 75.0%">' in bar
    assert '<b class="left" style="left: 25.0%">' in bar
    assert "width: 0.0%" in range_bar(0.0, 0.0, 0.0, "bar")
