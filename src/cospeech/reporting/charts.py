"""Charts on matplotlib: one style, as SVG inside a page or as a picture file."""

from __future__ import annotations

import functools
import hashlib
import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from cospeech.files import replacing
from cospeech.reporting.markup import one_line

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SERIES = tuple(f"c{i}" for i in range(1, 11))
"""Names of the colours of what is compared; they repeat after ten."""

_PHASES = {
    "preparation": "p1",
    "stroke": "p2",
    "hold": "p3",
    "pre_hold": "p4",
    "independent_hold": "p5",
    "rest_hold": "p6",
    "partial_retract": "p7",
    "retract": "p8",
    "retraction": "p8",
    "rest": "p6",
}
_ON_LIGHT, _ON_DARK = "#10151c", "#fefefe"
_LOG_RATIO = 30
_FARTHEST = 1e100
_PICTURE_DPI = 160
_GRID_M = 0.25
_TITLE = "title: "
_SVG, _HREF = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_FONT_FAMILY = re.compile(r" font-family: [^;]*;")
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_DOT = re.compile(r"M([-.\d]+ [-.\d]+)L\1(?![\d.])")
_DECIMAL = re.compile(r"-?\d+\.\d+")


@functools.cache
def _theme() -> dict[str, str]:
    """The light theme's colours of the pages by name, as their style sheet has them."""
    css = (files("cospeech.reporting") / "report.css").read_text(encoding="utf-8")
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", css.partition("@media")[0]))


@functools.cache
def _variables() -> dict[str, str]:
    return {value: f"var(--{name})" for name, value in _theme().items()}


def colour(name: str) -> str:
    """A colour of the pages' style sheet, such as ``muted``, as ``#rrggbb`` of its light theme.

    In a page's SVG it becomes the style sheet's variable again, and so follows the theme.
    """
    return _theme()[name]


def phase_colours(phase: str) -> tuple[str, str]:
    """A gesture phase's colour, and that of text on it; grey for one not known."""
    name = _PHASES.get(phase, "p0")
    on_it = {"p0": colour("text"), "p2": _ON_DARK, "p5": _ON_DARK}.get(name, _ON_LIGHT)
    return colour(name), on_it


@contextmanager
def chart_style() -> Iterator[None]:
    """Matplotlib's settings of every chart, for the time of building and writing it.

    As a decorator it holds for a whole function. The caller's settings don't count, and come back.
    """
    import matplotlib.style

    style = {
        "axes.axisbelow": True,
        "axes.edgecolor": colour("muted"),
        "axes.labelcolor": colour("muted"),
        "axes.spines.left": False,
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlecolor": colour("text"),
        "axes.titlelocation": "left",
        "axes.titlesize": "medium",
        "axes.xmargin": 0.0,
        "font.size": 11.5,
        "grid.color": colour("line"),
        "legend.frameon": False,
        "legend.labelcolor": colour("text"),
        "lines.linewidth": 1.7,
        "lines.scale_dashes": False,
        "lines.solid_capstyle": "butt",
        "path.simplify": False,
        "svg.fonttype": "none",  # text stays text: searchable, and in a font that has its letters
        "svg.hashsalt": "cospeech",
        "text.color": colour("text"),
        "text.parse_math": False,  # a run or a corpus may be called anything: no name is a formula
        "xtick.bottom": False,
        "xtick.labelcolor": colour("muted"),
        "ytick.labelcolor": colour("muted"),
        "ytick.left": False,
    }
    with warnings.catch_warnings(), matplotlib.style.context(["default", style]):
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        yield


def new_figure(width: float, height: float, layout: str | None = None) -> Figure:
    """A figure of a size in pixels of a page; not pyplot's, so no caller's figure is touched."""
    from matplotlib.figure import Figure

    return Figure((width / 72, height / 72), dpi=72, layout=layout)  # type: ignore[arg-type]


def new_axes(
    width: float, height: float, left: float, right: float, top: float, bottom: float
) -> tuple[Figure, Axes]:
    """A figure of a size, and its only axes with margins, in pixels of a page."""
    frame = (left, bottom, width - left - right, height - bottom - top)
    scale = (width, height, width, height)
    rectangle = (place / side for place, side in zip(frame, scale, strict=True))
    figure = new_figure(width, height)
    return figure, figure.add_axes(tuple(rectangle))  # type: ignore[arg-type]


def pixel_axes(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure that is all one place to draw on, in pixels of a page from its lower left corner."""
    figure, axes = new_axes(width, height, left=0, right=0, top=0, bottom=0)
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    return figure, axes


def titled(artist: Artist, text: str) -> None:
    """Let a page show a text while the pointer rests on what is drawn."""
    artist.set_gid(_TITLE + one_line(text))


def inline_svg(figure: Figure, style: str) -> str:
    """A figure as an ``<svg>`` element of a page, equal for equal figures.

    Its text is in the font of the page, and colours of the style sheet follow the theme.

    Args:
        figure: Built within `chart_style`.
        style: CSS class of the element.
    """
    for artist in figure.findobj():
        artist.set_clip_on(False)
    written = io.StringIO()
    figure.savefig(written, format="svg", transparent=True, metadata={"Date": None})
    root = ElementTree.fromstring(written.getvalue())
    # a page may hold several charts: their ids differ
    unique = hashlib.sha256(written.getvalue().encode()).hexdigest()[:8]
    shapes = {f"#{shape.get('id')}": shape for shape in root.iterfind(".//*[@id]")}
    for use in root.iter(f"{_SVG}use"):
        shapes[use.attrib[_HREF]].set("style", use.attrib.pop("style"))
    # what matplotlib's style sheet says, which would be obeyed by every SVG of the page
    chart = ElementTree.Element("svg", {"class": style, "role": "img", "stroke-linejoin": "round"})
    chart.set("viewBox", root.attrib["viewBox"])
    chart.extend(drawn for child in root for drawn in _simplified(child, unique))
    return ElementTree.tostring(chart, encoding="unicode")


def _simplified(element: ElementTree.Element, unique: str) -> list[ElementTree.Element]:
    """What stands for an element: no group or id without a use, no digit that nobody can see."""
    tag = element.tag.removeprefix(_SVG)
    title = element.get("id", "").partition(_TITLE)[2]
    children = [kept for child in element for kept in _simplified(child, unique)]
    if tag in ("metadata", "style") or element.get("style") == "fill: none":
        return []
    if tag in ("defs", "g") and not (children and (title or tag == "defs")):
        return children
    kept = ElementTree.Element(tag)
    kept.text = element.text
    if title:
        ElementTree.SubElement(kept, "title").text = title
    elif "id" in element.attrib:
        kept.set("id", f"{element.attrib['id']}-{unique}")
    if _HREF in element.attrib:
        kept.set("href", f"{element.attrib[_HREF]}-{unique}")
    for name in ("x", "y", "transform", "d"):
        if name in element.attrib and not element.attrib[name].startswith("rotate(-0"):
            short = _DECIMAL.sub(lambda found: f"{float(found[0]):.1f}", element.attrib[name])
            if name == "d":
                short = _DOT.sub(r"M\1h0", re.sub(r"\s*([A-Z]|z)\s*", r"\1", short.strip()))
            kept.set(name, short)
    if "style" in element.attrib:
        plain = _FONT_FAMILY.sub("", element.attrib["style"])
        kept.set("style", _COLOUR.sub(lambda found: _variables().get(found[0], found[0]), plain))
    kept.extend(children)
    return [kept]


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure built within `chart_style`; the file's ending chooses the format."""
    kind = path.suffix.removeprefix(".")
    metadata = {"Date": None} if kind == "svg" else None
    with replacing(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=_PICTURE_DPI, metadata=metadata)


@dataclass(frozen=True)
class Line:
    """A line of a chart.

    Attributes:
        name: Shown when the pointer rests on it.
        colour: One of `SERIES`.
        points: (x, y) in order of x; points that are not finite, or beyond 1e100, are left out.
    """

    name: str
    colour: str
    points: Sequence[tuple[float, float]]


@chart_style()
def line_chart(lines: Sequence[Line], x_title: str, y_title: str) -> str:
    """An SVG element with axes and lines.

    The vertical axis is logarithmic, and says so, where positive values span more than a factor
    of 30. A horizontal axis of whole numbers is marked at whole numbers; with a single one, zero is
    on the vertical axis.

    Args:
        lines: At least one with a finite point.
        x_title: Under the horizontal axis.
        y_title: Beside the vertical axis.

    Returns:
        ``<svg>...</svg>`` that needs no other file; empty when there is nothing to draw.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator

    finite = [
        [(x, y) for x, y in line.points if abs(x) < _FARTHEST and abs(y) < _FARTHEST]
        for line in lines
    ]
    ys = [y for points in finite for _, y in points]
    xs = {x for points in finite for x, _ in points}
    if not ys:
        return ""
    figure, axes = new_axes(720, 300, left=58, right=14, top=14, bottom=38)
    low, high = min(ys), max(ys)
    logarithmic = low > 1 / _FARTHEST and high / low > _LOG_RATIO
    for line, points in zip(lines, finite, strict=True):
        if points:
            (drawn,) = axes.plot(*zip(*points, strict=True), color=colour(line.colour))
            drawn.set_marker("o" if len(points) == 1 else "")
            titled(drawn, line.name)
    if logarithmic:
        axes.set_yscale("log", subs=[])
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    elif len(xs) == 1 and low != 0 != high:
        # dots of one epoch have no course that a near view could show
        axes.set_ylim(min(0, 1.25 * low), max(0, 1.25 * high))
    elif 0 < low < 0.4 * high:
        # lines may start at zero when it is near: a tall axis that hides it exaggerates
        axes.set_ylim(bottom=0)
    if len(xs) == 1:
        (only,) = xs
        beside = max(1, 0.01 * abs(only))
        axes.set_xlim(only - beside, only + beside)
        axes.set_xticks([only])
    elif all(float(x).is_integer() for x in xs):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(axis="y")
    axes.set_xlabel(one_line(x_title))
    axes.set_ylabel(one_line(y_title) + (", logarithmic" if logarithmic else ""))
    return inline_svg(figure, "chart")


def front_view(
    low: NDArray[np.float64], high: NDArray[np.float64], px_per_m: float
) -> tuple[Figure, Axes]:
    """A figure of places seen from the front, and its axes; the grid is 25 cm.

    Args:
        low: Least x and y shown, metres.
        high: The largest.
        px_per_m: Pixels of a page per metre.
    """
    width, height = px_per_m * (high - low)
    figure, axes = new_axes(width, height, left=0, right=0, top=0, bottom=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for axis, start, end in zip((axes.xaxis, axes.yaxis), low, high, strict=True):
        axis.set_ticks(np.arange(np.ceil(start / _GRID_M), end / _GRID_M) * _GRID_M, labels=[])
    axes.spines[:].set_visible(False)
    axes.grid(axis="both")
    return figure, axes


def draw_bones(
    axes: Axes, pose: NDArray[np.float64], bones: Sequence[tuple[int, int]], **style: Any
) -> None:
    """Lines between the joints of a pose ``(J, 2)``, metres."""
    from matplotlib.collections import LineCollection

    ends = [pose[[parent, child]] for parent, child in bones]
    axes.add_collection(LineCollection(ends, capstyle="round", **style), autolim=False)


def draw_path(axes: Axes, corners: NDArray[np.float64], **style: Any) -> None:
    """Many small shapes as one, whose parts don't darken one another where they overlap.

    Args:
        axes: Where.
        corners: ``(N, C, 2)``, the corners of each; two equal ones are a dot.
        style: Of a matplotlib patch.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    count, corners_each, _ = corners.shape
    if not count:
        return
    codes = np.tile([Outline.MOVETO] + [Outline.LINETO] * (corners_each - 1), count)
    outline = Outline(corners.reshape(-1, 2), codes)
    # not add_patch, which asks each one how far the axes must reach
    axes.add_artist(PathPatch(outline, **style))
