"""The page of the paper's figures: what is drawn where, and that it needs nothing else."""

import dataclasses
import re
from collections import Counter
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from cospeech.metrics.phase_structure import count_phases, phase_structure
from cospeech.studies.multi_adversary_figures.curves import range_chart, velocity_chart
from cospeech.studies.multi_adversary_figures.findings import judge
from cospeech.studies.multi_adversary_figures.measured import Setting, SystemMotion
from cospeech.studies.multi_adversary_figures.measuring import measure_systems
from cospeech.studies.multi_adversary_figures.page import write_page
from cospeech.studies.multi_adversary_figures.phase_charts import (
    duration_chart,
    share_chart,
    transition_matrices,
)
from cospeech.studies.multi_adversary_figures.scatter import scatter_panels
from cospeech.studies.multi_adversary_figures.styles import shown, style_of, title_of
from cospeech.studies.multi_adversary_figures.tables import (
    findings_table,
    numbers_table,
    tally,
    text_table,
)
from tests.reporting.drawn import drawn, texts

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
    return SystemMotion(name, windows, takes, takes, phases=phases, seed=seed, fgd=1.0)


@pytest.fixture(scope="module")
def systems():
    motions = [motion("real", 0.010), motion("full", 0.009, 0), motion("no_minibatch", 0.02, 0)]
    return measure_systems(SETTING, motions, 0, 20)


def page(systems, tmp_path, **changes):
    given = {"corpus": "corpus", "split": "test", "setting": SETTING, "facts": [("seed", "0")]}
    path = tmp_path / "page.html"
    write_page(path, systems=systems, verdicts=judge(systems), **given | changes)
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
    chart = velocity_chart(systems)
    lines = {title: paths[0] for title, paths in drawn(chart)}
    real, full, collapsed = (lines[name] for name in ("real", "full model", "no minibatch"))
    assert len(real) == 99
    # 20, 18 and 40 cm/s: real is twice as far from the third as ten times from the second
    heights = [-line[0][1] for line in (real, full, collapsed)]
    assert heights[2] - heights[0] == pytest.approx(10 * (heights[0] - heights[1]), abs=1.1)
    # evenly spaced steps
    np.testing.assert_allclose(np.diff([x for x, _ in real]), real[1][0] - real[0][0], atol=0.11)
    # 40 cm/s are 2 cm per frame, and no step has the number 35
    assert {"2", "35"} <= set(texts(chart))


def test_lines_differ_without_their_colours():
    styles = [style_of(place) for place in range(13)]
    assert len({(style.dash, style.marker) for style in styles}) == len(styles)
    assert len({style.colour for style in styles[:11]}) == 11
    assert [style.colour for style in styles].count("c0") == 1


def test_lines_are_named_in_the_order_in_which_they_end():
    motions = [motion("real", 0.01), *(motion(f"s{i}", 0.0015 * i, 0) for i in range(12))]
    found = measure_systems(SETTING, motions, 0, 5)
    chart = velocity_chart(found)
    names = [text for text in texts(chart) if re.fullmatch(r"real|s\d+", text)]
    assert names == ["s11", "s10", "s9", "s8", "s7", "real", *(f"s{i}" for i in range(6, -1, -1))]
    root = ElementTree.fromstring(chart)
    bottom = float(root.get("viewBox").split()[3])
    heights = [float(e.get("y")) for e in root.iter("text") if e.text in names]
    assert 0 < heights[0] < heights[-1] < bottom
    assert min(np.diff(heights)) > 11


def test_a_point_per_window_and_seed_in_the_range_chart():
    motions = [motion("real", 0.01), motion("full", 0.02, 0), motion("full", 0.03, 1)]
    found = measure_systems(SETTING, motions, 0, 5)
    chart = range_chart(found)
    ids = {e.get("id"): e.get("style") for e in ElementTree.fromstring(chart).iter("path")}
    points = Counter(ids[e.get("href")[1:]] for e in ElementTree.fromstring(chart).iter("use"))
    by_colour = {re.search(r"--(c\d+)", style)[1]: count for style, count in points.items()}
    assert by_colour == {"c0": 12, "c1": 24}
    # one height for each speed, those of seeds among them
    heights = {e.get("y") for e in ElementTree.fromstring(chart).iter("use")}
    assert len(heights) == 3
    # 99 steps of 1 cm straight up
    assert drawn(chart)[0][0] == "median 99.0 cm, quartiles 99.0 and 99.0 cm"
    assert {"real", "full model"} <= set(texts(chart))


def test_scatter_shows_what_is_near_and_counts_what_is_beyond():
    far = motion("full", 0.01, 0)
    far.recordings[0][:100, 2, 0] += 9
    found = measure_systems(SETTING, [motion("real", 0.01), far], 0, 5)
    text = scatter_panels(found, SETTING)
    # four positions a second of 20 frames: 20 of the first 100 frames
    assert "480 poses</small>" in text
    assert "480 poses, 20 of them beyond</small>" in text
    left_wrist = re.findall(r'd="([^"]*)" style="[^"]*#e8741c', text.split("<figure>")[2])
    assert sum(dots.count("h0") for dots in left_wrist) == 460


def test_shares_fill_the_bar_and_transitions_are_per_cent():
    structure = phase_structure([count_phases(np.array([0] * 5 + [1] * 10 + [2] * 5), 4, 20.0)], 20)
    bars = drawn(share_chart([("real", structure)], CLASSES))
    widths = [np.ptp([x for x, _ in corners]) for _, (corners,) in bars[:3]]
    np.testing.assert_allclose(np.array(widths) / sum(widths), [0.25, 0.5, 0.25], atol=1e-3)
    # each begins where the one before it ends
    ends = [(min(x for x, _ in corners), max(x for x, _ in corners)) for _, (corners,) in bars]
    assert [ends[1][0], ends[2][0]] == pytest.approx([ends[0][1], ends[1][1]], abs=0.11)
    assert [title for title, _ in bars[:2]] == ["preparation: 25.0 %", "stroke: 50.0 %"]
    matrix = transition_matrices([("real", structure)], CLASSES)
    assert matrix.count(">100</td>") == 2
    assert matrix.count(">0</td>") == 4
    # nothing follows hold, and other never comes
    assert matrix.count(">\N{EN DASH}</td>") == 6


def test_long_durations_end_in_an_arrow_and_missing_ones_are_named():
    short = phase_structure([count_phases(np.array([0, 0, 1, 1]), 2, 20.0)], 20.0)
    long = phase_structure([count_phases(np.zeros(600, dtype=int), 2, 20.0)], 20.0)
    chart = duration_chart([("real", short), ("MSE only", long)], ("hold", "stroke"))
    assert texts(chart).count("0.10") == 2
    assert "30.00" in texts(chart)
    assert "never" in texts(chart)
    # two dots and a triangle that begins where no curve does
    markers = [e.get("d") for e in ElementTree.fromstring(chart).iter("path") if e.get("id")]
    assert sorted("C" in marker for marker in markers) == [False, True, True]


def test_the_numbers_are_in_the_tables(systems):
    table = numbers_table(systems)
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
