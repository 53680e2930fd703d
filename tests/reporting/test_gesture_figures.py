"""The page of gesture figures: what is drawn where, and that it needs nothing else."""

import dataclasses
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from cospeech.metrics.gesture_statistics.findings import judge
from cospeech.metrics.gesture_statistics.measuring import measure_systems
from cospeech.metrics.gesture_statistics.phase_structure import count_phases, phase_structure
from cospeech.metrics.gesture_statistics.systems import Setting, SystemMotion
from cospeech.reporting.gesture_figures import GestureFigures, text_table, write_gesture_figures
from cospeech.reporting.gesture_figures.curves import range_chart, velocity_chart
from cospeech.reporting.gesture_figures.looks import lines_of, looks_of, shown, title_of
from cospeech.reporting.gesture_figures.phase_charts import (
    duration_chart,
    share_chart,
    transition_matrices,
)
from cospeech.reporting.gesture_figures.scatter import scatter_panels
from cospeech.reporting.gesture_figures.texts import findings_table, numbers_table, tally

HOSTILE = '</td><script>alert("1")</script>&'
ROLES = (
    "left_shoulder", "left_elbow", "left_wrist", "left_thumb_tip",
    "right_shoulder", "right_elbow", "right_wrist", "right_thumb_tip", "neck",
)  # fmt: skip
BONES = ((8, 0), (0, 1), (1, 2), (2, 3), (8, 4), (4, 5), (5, 6), (6, 7))
REST = np.array(
    [[0.2, 0.5, 0], [0.3, 0.2, 0], [0.3, 0, 0.2], [0.3, -0.1, 0.2],
     [-0.2, 0.5, 0], [-0.3, 0.2, 0], [-0.3, 0, 0.2], [-0.3, -0.1, 0.2], [0, 0.5, 0]]
)  # fmt: skip
CLASSES = ("preparation", "stroke", "hold", "other")
SETTING = Setting(ROLES, BONES, REST, np.repeat(np.arange(6), 4), np.arange(0, 24, 2), CLASSES)


def motion(name, speed, seed=None):
    """Both wrists (and thumbs) rise by ``speed`` metres per step."""
    windows = np.tile(REST, (24, 100, 1, 1))
    windows[:, :, [2, 3, 6, 7], 1] += speed * np.arange(100)[None, :, None]
    takes = [windows[i : i + 4].reshape(400, 9, 3) for i in range(0, 24, 4)]
    rng = np.random.default_rng(len(name))
    phases = [np.repeat(rng.integers(0, 4, 40), 10) for _ in takes]
    return SystemMotion(name, windows, takes, side_by_side=takes, phases=phases, seed=seed, fgd=1.0)


@pytest.fixture(scope="module")
def systems():
    motions = [motion("real", 0.010), motion("full", 0.009, 0), motion("no_minibatch", 0.02, 0)]
    return measure_systems(SETTING, motions, 0, 20)


def page(systems, tmp_path, **changes):
    figures = GestureFigures("corpus", "test", SETTING, systems, judge(systems), [("seed", "0")])
    path = write_gesture_figures(dataclasses.replace(figures, **changes), tmp_path / "page.html")
    return path.read_text(encoding="utf-8")


class Tags(HTMLParser):
    """Fails where a tag isn't closed by its own."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.open = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def lines(svg, style="line"):
    """Points of the polylines of a chart, by CSS class of the system."""
    found = {}
    for element in ElementTree.fromstring(svg).iter("polyline"):
        words = element.get("class").split()
        if words[0] == style:
            points = [tuple(map(float, p.split(","))) for p in element.get("points").split()]
            found[words[1]] = points
    return found


def test_the_page_is_well_formed_and_needs_no_other_file(systems, tmp_path):
    annotated = phase_structure([count_phases(np.array([0, 1, 2, 3]), 4, 20.0)], 20.0)
    text = page(systems, tmp_path, annotated=annotated)
    found = Tags(text)
    names = {name for name, _ in found.attributes}
    assert "script" not in found.tags
    assert not names & {"src", "srcset", "xlink:href", "data", "action"}
    targets = [value for name, value in found.attributes if name == "href"]
    assert targets
    ids = {value for name, value in found.attributes if name == "id"}
    assert {target.removeprefix("#") for target in targets} == ids
    assert not re.search(r"https?:|url\(|@import|<link", text)
    assert not re.search(r"\bnan\b|\binf\b|None", text)
    for svg in re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL):
        ElementTree.fromstring(svg)


def test_everything_from_outside_is_escaped(tmp_path):
    roles = (*ROLES[:-1], HOSTILE)
    setting = dataclasses.replace(SETTING, roles=roles, phase_classes=(*CLASSES[:3], HOSTILE))
    found = measure_systems(setting, [motion("real", 0.01), motion(HOSTILE, 0.02, 0)], 0, 20)
    text = page(
        found,
        tmp_path,
        corpus=HOSTILE,
        split=HOSTILE,
        setting=setting,
        facts=[(HOSTILE, HOSTILE)],
        annotated=found[0].phases,
    )
    assert "script" not in Tags(text).tags
    assert "<script" not in text
    assert "&lt;script" in text


def test_a_line_is_where_its_velocity_is(systems):
    chart = velocity_chart(systems, looks_of([s.name for s in systems]), 20.0)
    real, full, collapsed = (lines(chart)[style] for style in ("c0", "c1", "c2"))
    assert len(real) == 99
    # 20, 18 and 40 cm/s on an axis that begins at 0
    floor = next(
        float(e.get("d").split()[1].split("H")[0])
        for e in ElementTree.fromstring(chart).iter("path")
        if e.get("class") == "axis"
    )
    heights = [floor - line[0][1] for line in (real, full, collapsed)]
    np.testing.assert_allclose(np.array(heights) / heights[0], [1, 0.9, 2], rtol=0.01)
    # evenly spaced steps
    np.testing.assert_allclose(np.diff([x for x, _ in real]), real[1][0] - real[0][0], atol=0.11)


def test_lines_differ_without_their_colours():
    names = ["real", *"abcdefghijkl"]
    looks = looks_of(names)
    drawn = [(look.dash, look.marker) for look in looks.values()]
    assert len(set(drawn)) == len(names)
    assert len({look.style for look in list(looks.values())[:9]}) == 9
    assert [look.style for look in looks.values()].count("c0") == 1


def test_names_at_the_right_neither_overlap_nor_leave_the_chart():
    motions = [motion("real", 0.01), *(motion(f"s{i}", 0.0002 * i, 0) for i in range(12))]
    found = measure_systems(SETTING, motions, 0, 5)
    chart = ElementTree.fromstring(velocity_chart(found, looks_of([s.name for s in found]), 20.0))
    names = [e for e in chart.iter("text") if e.get("class") == "name"]
    heights = sorted(float(e.get("y")) for e in names)
    assert len(heights) == 13
    assert min(np.diff(heights)) >= 20.9
    bottom = float(chart.get("viewBox").split()[3])
    assert heights[0] > 0
    assert heights[-1] < bottom


def test_a_point_per_window_and_seed_in_the_range_chart():
    motions = [motion("real", 0.01), motion("full", 0.02, 0), motion("full", 0.03, 1)]
    found = measure_systems(SETTING, motions, 0, 5)
    chart = range_chart(found, looks_of([s.name for s in found]))
    points = [
        e.get("d").count("M")
        for e in ElementTree.fromstring(chart).iter("path")
        if e.get("class").startswith("point")
    ]
    assert points == [12, 24]
    # 99 steps of 1 cm straight up
    assert "median 99.0 cm, quartiles 99.0 and 99.0 cm" in chart


def test_scatter_shows_what_is_near_and_counts_what_is_beyond():
    far = motion("full", 0.01, 0)
    far.recordings[0][:100, 2, 0] += 9
    found = measure_systems(SETTING, [motion("real", 0.01), far], 0, 5)
    text = scatter_panels(found, SETTING)
    # four positions a second of 20 frames: 20 of the first 100 frames
    assert "480 poses</small>" in text
    assert "480 poses, 20 of them beyond</small>" in text
    dots = re.findall(r'class="dot left wrist" d="([^"]*)"', text.split("<figure>")[2])
    assert sum(d.count("M") for d in dots) == 460


def test_shares_fill_the_bar_and_transitions_are_per_cent():
    structure = phase_structure([count_phases(np.array([0] * 5 + [1] * 10 + [2] * 5), 4, 20.0)], 20)
    bar = ElementTree.fromstring(share_chart([("real", structure)], CLASSES))
    rects = [e for e in bar.iter("rect") if e.find("title") is not None]
    widths = [float(e.get("width")) for e in rects]
    np.testing.assert_allclose(np.array(widths) / sum(widths), [0.25, 0.5, 0.25], atol=1e-3)
    assert [e.find("title").text for e in rects][1] == "stroke: 50.0 %"
    matrix = transition_matrices([("real", structure)], CLASSES)
    assert matrix.count(">100</text>") == 2
    assert matrix.count(">0</text>") == 4
    # nothing follows hold, and other never comes
    assert matrix.count(">\N{EN DASH}</text>") == 6


def test_long_durations_end_in_an_arrow_and_missing_ones_are_named():
    short = phase_structure([count_phases(np.array([0, 0, 1, 1]), 2, 20.0)], 20.0)
    long = phase_structure([count_phases(np.zeros(600, dtype=int), 2, 20.0)], 20.0)
    chart = ElementTree.fromstring(
        duration_chart([("real", short), ("MSE only", long)], ("hold", "stroke"))
    )
    texts = [e.text for e in chart.iter("text")]
    assert texts.count("0.10") == 2
    assert "30.00" in texts
    assert "never" in texts
    assert len(list(chart.iter("circle"))) == 2


def test_the_numbers_are_in_the_tables(systems):
    looks = looks_of([s.name for s in systems])
    table = numbers_table(systems, looks)
    assert "<td>20.0<small>20.0 to 20.0</small><small>1.00 cm/frame</small></td>" in table
    assert "no minibatch &gt; real &gt; full model" in table
    text = text_table(systems, judge(systems))
    (velocity,) = [line for line in text.splitlines() if line.startswith("wrist velocity")]
    assert velocity.split()[-3:] == ["20.0", "18.0", "40.0"]
    assert "holds                without the minibatch discriminator, motion is faster" in text


def test_findings_with_their_numbers(systems):
    table = findings_table(judge(systems))
    assert "real <b>20.0</b> &lt; no minibatch <b>40.0</b>" in table
    assert "full model <b>18.0</b> &lt; 1.25 &times; real <b>20.0</b>" in table
    # of the same claim both ways round, in the order of the claim
    assert "real <b>20.0</b> &lt; 1.25 &times; full model <b>18.0</b>" in table
    assert "not run: no displacement, MSE only" in table
    assert "not run" in tally(judge(systems))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "\N{EN DASH}"),
        (float("nan"), "\N{EN DASH}"),
        (0.0, "0"),
        (1.0, "1.00"),
        (12.345, "12.3"),
        (123.45, "123"),
        (1234.5, "1234"),
        (0.05678, "0.0568"),
        (0.0004, "≈0"),
        (-2.5, "-2.50"),
    ],
)
def test_three_digits(value, text):
    assert shown(value) == text


def test_titles():
    assert [title_of(n) for n in ("full", "mse_only", "no_motion")] == [
        "full model",
        "MSE only",
        "no motion",
    ]
    assert lines_of("no displacement <b>", 12) == ["no", "displacement", "&lt;b&gt;"]
