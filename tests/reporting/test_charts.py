"""The room that draws charts: values where they belong, any name, the page's theme, same bytes."""

import re
import subprocess
import sys
import warnings
from importlib.resources import files
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest

from cospeech.reporting.charts import (
    SERIES,
    Line,
    chart_style,
    colour,
    draw_path,
    front_view,
    inline_svg,
    line_chart,
    new_axes,
    save_picture,
    titled,
)
from tests.reporting.drawn import drawn, texts

HOSTILE = (
    "<script>alert(1)</script>",
    "$x_{$",
    "$x^2$",
    'a" onload="b',
    "half \ud83d",
    "中文 🎉",
    "_a",
)


def test_lines_turn_logarithmic_and_skip_what_is_not_finite():
    points = [(0, 1000.0), (1, float("nan")), (2, 10.0), (3, 0.1)]
    chart = line_chart([Line("a & b", "c1", points)], "epoch", "fgd")
    ((title, (corners,)),) = drawn(chart)
    assert title == "a & b"
    assert len(corners) == 3
    # two decades each: equal steps down
    steps = np.diff([y for _, y in corners])
    assert steps[0] == pytest.approx(steps[1], abs=0.11)
    assert steps[0] > 0
    assert "fgd, logarithmic" in texts(chart)
    assert {"0.1", "10", "1000"} <= set(texts(chart))


def test_nothing_to_draw_is_no_chart():
    assert line_chart([Line("a", "c1", [(0, float("inf"))])], "x", "y") == ""
    assert line_chart([Line("a", "c1", [(0, 1e308), (1, -1e308)])], "x", "y") == ""
    assert line_chart([], "x", "y") == ""


@pytest.mark.parametrize("most", [1e-99, 1e20, 9e99])
def test_enormous_and_tiny_values_stay_inside(most):
    for low in (most, -most, 0.0):
        chart = line_chart([Line("a", "c1", [(0, low), (1, most)])], "x", "y")
        (_, (corners,)) = drawn(chart)[0]
        assert all(0 <= x <= 720 and 0 <= y <= 300 for x, y in corners)


def test_a_single_value_is_a_dot():
    chart = line_chart([Line("a", "c1", [(4, 2.0)])], "x", "y")
    assert chart.count("<use ") == 1
    ((x, y),) = drawn(chart)[0][1][-1]
    assert x == 382.0
    assert y == pytest.approx(14 + 248 / 5, abs=0.1)  # of an axis from 0 to a fourth above it


@pytest.mark.parametrize(("epoch", "value"), [(0, 2.0), (0, -2.0), (7, 0.0), (1e99, 1e99)])
def test_a_single_epoch_is_marked_by_its_number_beside_zero(epoch, value):
    chart = line_chart([Line("a", "c1", [(epoch, value)])], "epoch", "fgd")
    below = texts(chart)[: texts(chart).index("epoch")]
    assert below == [f"{epoch:g}"]
    assert "0" in texts(chart)[len(below) + 1 :]


def test_several_seeds_of_a_single_epoch_are_not_drawn_apart():
    lines = [Line(str(y), "c1", [(0, y)]) for y in (2.0, 2.01)]
    (low,), (high,) = (drawn(line_chart(lines, "epoch", "fgd"))[i][1][-1] for i in range(2))
    assert 0 < low[1] - high[1] < 2


@pytest.mark.parametrize("last", [1, 2, 3, 12, 300])
def test_epochs_are_marked_at_whole_numbers(last):
    chart = line_chart([Line("a", "c1", [(x, 1.0 + x) for x in range(last + 1)])], "epoch", "y")
    below = texts(chart)[: texts(chart).index("epoch")]
    assert len(below) >= 2
    assert all(text.isdigit() and int(text) <= last for text in below)


def test_an_axis_begins_at_zero_where_zero_is_near():
    assert "0" in texts(line_chart([Line("a", "c1", [(1, 1.0), (2, 8.0)])], "x", "y"))
    assert "0" not in texts(line_chart([Line("a", "c1", [(1, 7.0), (2, 8.0)])], "x", "y"))


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_drawn_as_they_are(name, tmp_path):
    shown = name.replace("\ud83d", "\N{REPLACEMENT CHARACTER}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chart = line_chart([Line(name, "c1", [(0, 1.0), (1, 2.0)])], name, name)
    root = ElementTree.fromstring(chart)
    assert [text for text in texts(chart) if not re.fullmatch(r"[\d.]+", text)] == [shown, shown]
    assert drawn(chart)[0][0] == shown
    assert {element.tag for element in root.iter()} == {"svg", "g", "path", "text", "title"}
    known = {"class", "role", "viewBox", "stroke-linejoin", "style", "d", "x", "y", "transform"}
    assert {key for element in root.iter() for key in element.attrib} <= known


def test_colours_of_the_style_sheet_follow_the_theme():
    assert all(re.fullmatch("#[0-9a-f]{6}", colour(name)) for name in SERIES)
    assert len({colour(name) for name in SERIES}) == len(SERIES)
    chart = line_chart([Line("#6b7686", "c3", [(0, 1.0), (1, 2.0)])], "x", colour("muted"))
    assert "stroke: var(--c3)" in chart
    assert "fill: var(--muted)" in chart
    assert colour("c3") not in chart
    # what is written is not what is painted
    assert texts(chart)[-1] == colour("muted")
    css = (files("cospeech.reporting") / "report.css").read_text(encoding="utf-8")
    dark = css.partition("@media")[2]
    assert all(f"--{name}: " in dark for name in (*SERIES, "c0", "text", "muted", "line"))


def test_equal_charts_have_equal_bytes_and_ids_of_their_own(tmp_path):
    def chart(value):
        return line_chart([Line("a", "c1", [(0, value)])], "x", "y")

    assert chart(1.0) == chart(1.0)
    ids = [re.search(r'<path id="([^"]+)"', chart(value))[1] for value in (1.0, 2.0)]
    assert ids[0] != ids[1]
    assert f'href="#{ids[0]}"' in chart(1.0)
    for name in ("a.svg", "b.svg"):
        with chart_style():
            figure, axes = new_axes(200, 100, 20, 20, 20, 20)
            axes.plot([0, 1], [0, 1], "o")
            save_picture(figure, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


@chart_style()
def test_a_chart_says_nothing_to_the_rest_of_its_page():
    figure, axes = new_axes(200, 100, 20, 20, 20, 20)
    titled(axes.plot([0, 1], [0, 1])[0], "line")
    chart = inline_svg(figure, "chart")
    assert not re.search(r"<style|xmlns|url\(|https?:|font-family|clip", chart)


def test_the_callers_settings_come_back_and_do_not_count(tmp_path):
    plain = line_chart([Line("a", "c1", [(0, 1.0), (1, 2.0)])], "x", "y")
    with matplotlib.rc_context({"lines.linewidth": 40, "font.size": 3, "axes.grid": True}):
        before = dict(matplotlib.rcParams)
        assert line_chart([Line("a", "c1", [(0, 1.0), (1, 2.0)])], "x", "y") == plain
        assert dict(matplotlib.rcParams) == before


@chart_style()
def test_a_view_has_one_scale_and_many_dots_are_one_path():
    figure, axes = front_view(np.array([-1.0, 0.0]), np.array([1.0, 0.5]), 100)
    dots = np.array([[0.0, 0.25], [1.0, 0.5]])
    draw_path(axes, np.repeat(dots[:, None], 2, axis=1), edgecolor="#010203", fill=False)
    root = ElementTree.fromstring(inline_svg(figure, "view"))
    assert root.get("viewBox") == "0 0 200 50"
    (path,) = [path for path in root.iter("path") if "#010203" in path.get("style")]
    assert path.get("d") == "M100 25h0M200 0h0"


def test_matplotlib_is_loaded_when_something_is_drawn():
    code = "import cospeech.reporting.report, cospeech.reporting.corpus_report.page, sys"
    code += "; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
