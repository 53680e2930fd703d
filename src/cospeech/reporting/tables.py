"""Tables of results, as plain text for a terminal or as Markdown."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from cospeech.reporting.markup import markdown, one_line

MISSING = "\N{EN DASH}"
_MOST_CHARACTERS = 300
_ARROWS = {"lower": "↓", "higher": "↑", None: ""}

Direction = Literal["lower", "higher"] | None
"""Whether a lower or a higher number is better; None where neither is."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: Key of the rows' values.
        title: Heading; the key itself when empty.
        better: Shown as an arrow beside the title.
    """

    key: str
    title: str = ""
    better: Direction = None

    @property
    def heading(self) -> str:
        """Title with its arrow."""
        return f"{self.title or self.key} {_ARROWS[self.better]}".rstrip()


_BEFORE_RECORDS_SAID: tuple[Column, ...] = (
    Column("fgd", "FGD", "lower"),
    Column("fgd_extrapolated", "FGD at n → ∞", "lower"),
    Column("kernel_distance", "kernel distance", "lower"),
    Column("feature_distance", "feature distance", "lower"),
    Column("joint_mae", "joint error, m", "lower"),
    Column("acceleration_error", "accel. error, m/frame²", "lower"),
)


def metric_columns(*records: Mapping[str, Any]) -> tuple[Column, ...]:
    """The metrics that records name, in order; of older ones, those that there were.

    Args:
        records: Values of a ``record.json`` or ``evaluation.json``.
    """
    columns = dict[str, Column]()
    for record in records:
        named = record.get("metrics")
        for metric in named if isinstance(named, list) else ():
            column = Column(metric["key"], metric.get("title", ""), metric.get("better"))
            columns.setdefault(column.key, column)
    return tuple(columns.values()) or _BEFORE_RECORDS_SAID


@dataclass(frozen=True)
class Summary:
    """A number over several runs.

    Attributes:
        mean: Mean.
        std: Sample standard deviation (n - 1); None for one run.
        n: Number of runs.
        ci95: 95 % interval of the mean by Student's t; None for one run. Three runs make it wide,
            as they should.
        of: Number of runs that there are, where some have no value; it says so then.
    """

    mean: float
    std: float | None
    n: int
    ci95: tuple[float, float] | None
    of: int | None = None

    def __str__(self) -> str:
        some = "" if self.of in (None, self.n) else f" (n={self.n})"
        if self.std is None:
            return f"{format_value(self.mean)}{some}"
        decimals = _decimals(self.std, 2) if self.std > 0 else _decimals(self.mean, 4)
        return f"{self.mean:.{decimals}f} ± {self.std:.{decimals}f}{some}"


def summarise(values: Iterable[float]) -> Summary | None:
    """Mean, standard deviation and t interval of finite values; None when there are none."""
    finite = [float(value) for value in values if math.isfinite(value)]
    if not finite:
        return None
    mean = statistics.fmean(finite)
    if len(finite) == 1:
        return Summary(mean, None, 1, None)
    from scipy.stats import t

    std = statistics.stdev(finite)
    half = float(t.ppf(0.975, len(finite) - 1)) * std / math.sqrt(len(finite))
    return Summary(mean, std, len(finite), (mean - half, mean + half))


def _decimals(value: float, significant: int) -> int:
    if value == 0 or not math.isfinite(value):
        return 0
    return max(0, significant - 1 - math.floor(math.log10(abs(value))))


def format_value(value: Any) -> str:
    """A cell's text: four significant digits, whole numbers whole, ``–`` for nothing.

    Texts are on one line, and cut after 300 characters.
    """
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        if value == int(value) and abs(value) < 1e15:
            return str(int(value))
        if abs(value) < 1e-4 or abs(value) >= 1e7:
            return f"{value:.3g}"
        return f"{value:.{_decimals(value, 4)}f}"
    text = one_line(value)
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 1]}…"


def format_table(
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[Column | str] | None = None,
    style: Literal["text", "markdown"] = "text",
) -> str:
    """A table of rows.

    Args:
        rows: Values by column key; a missing one shows as ``–``.
        columns: What to show, in order; every key of any row when None.
        style: ``"text"`` for a terminal, ``"markdown"`` for a README.

    Returns:
        Lines joined by newlines, without a last one. Columns of numbers are right-aligned.
    """
    if columns is None:
        columns = list(dict.fromkeys(key for row in rows for key in row))
    shown = [column if isinstance(column, Column) else Column(column) for column in columns]
    cells = [[format_value(row.get(column.key)) for column in shown] for row in rows]
    right = [
        any(row.get(column.key) is not None for row in rows)
        and all(isinstance(row.get(column.key), (int, float, Summary, type(None))) for row in rows)
        for column in shown
    ]
    headings = [one_line(column.heading) for column in shown]
    if style == "markdown":
        headings = [markdown(heading) for heading in headings]
        cells = [[markdown(cell) for cell in row] for row in cells]
        rule = ["---:" if to_right else "---" for to_right in right]
        return "\n".join(f"| {' | '.join(line)} |" for line in (headings, rule, *cells))
    widths = [max(len(line[i]) for line in (headings, *cells)) for i in range(len(shown))]

    def lined_up(line: Sequence[str]) -> str:
        return "  ".join(
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(line, widths, right, strict=True)
        ).rstrip()

    rule_line = "  ".join("─" * width for width in widths)
    return "\n".join([lined_up(headings), rule_line, *(lined_up(line) for line in cells)])


def result_table(record: Mapping[str, Any]) -> str:
    """One run's final numbers under both protocols, and the reference rows to read them by.

    Args:
        record: Values of a ``record.json``, or of an ``evaluation.json``; missing parts are
            left out.

    Returns:
        The table, and a line that says how the numbers came about.
    """
    final = _mapping(record.get("final"))
    rows: list[dict[str, Any]] = []
    for protocol in ("windows", "recordings"):
        values = _mapping(final.get(protocol))
        if values:
            rows.append({"row": f"{record.get('model')} ({protocol})", **with_interval(values)})
    for name, values in _mapping(record.get("references")).items():
        rows.append({"row": str(name).replace("_", " "), **with_interval(_mapping(values))})
    columns = [Column("row", " ")]
    for metric in metric_columns(record):
        if any(row.get(metric.key) is not None for row in rows):
            columns.append(metric)
            if metric.key == "fgd" and any("interval" in row for row in rows):
                columns.append(Column("interval", "95 % over recordings"))
    encoder = _mapping(record.get("encoder"))
    facts = [
        f"split: {final.get('split', MISSING)}",
        f"seed: {record.get('seed', MISSING)}",
        f"encoder: {encoder.get('name', MISSING)} {str(encoder.get('sha256', ''))[:12]}".rstrip(),
    ]
    windows = _mapping(final.get("recordings")).get("windows")
    if windows is not None:
        facts.append(f"windows: {format_value(windows)}")
    return f"{format_table(rows, columns)}\n\n{one_line(' · '.join(facts))}"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def with_interval(values: Mapping[str, Any]) -> dict[str, Any]:
    """Final metrics or a reference row, with the FGD's interval as one text where it has one."""
    low, high = values.get("fgd_low"), values.get("fgd_high")
    if low is None or high is None:
        return dict(values)
    return {**values, "interval": f"{format_value(low)} to {format_value(high)}"}
