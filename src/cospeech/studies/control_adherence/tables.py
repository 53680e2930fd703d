"""The study's tables, in centimetres, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from cospeech.matching.control import QUANTITIES
from cospeech.reporting.tables import Column, format_table
from cospeech.studies.control_adherence.measuring import (
    Adherence,
    Change,
    Shift,
    Spread,
    Windows,
)
from cospeech.studies.control_adherence.tested_controls import FAST_AND_HIGH, SLOW_AND_LOW

Style = Literal["text", "markdown"]


def adherence_table(rows: Sequence[Adherence], style: Style) -> str:
    """Table 2, in centimetres, with what the paper has on its corpus."""
    lines = []
    for row in rows:
        refined = "cGAN" in row.stage
        mean, deviation = row.tested.published[3:] if refined else row.tested.published[1:3]
        lines.append(
            {
                "control": f"{row.tested.name}, {unit_of(row.tested.quantity)}",
                "stage": row.stage,
                "threshold": f"{100 * row.threshold:.1f}",
                "real": _cell(row.real),
                "free": _cell(row.free),
                "controlled": _cell(row.controlled),
                "within": f"{100 * row.free.within:.1f} → {100 * row.controlled.within:.1f}",
                "share": f"{_percent(row.free)} → {_percent(row.controlled)}",
                "shift": f"{100 * row.shift.value:.1f}",
                "interval": _interval(row.shift),
                "verdict": row.verdict,
                "windows": round(row.windows.mean),
                "fewest": row.windows.fewest,
                "paper": f"{100 * row.tested.published[0]:.1f}:"
                f" {100 * mean:.1f} ({100 * deviation:.1f})",
            }
        )
    columns: list[Column | str] = [
        "control",
        "stage",
        "threshold",
        Column("real", "recorded"),
        Column("free", "uncontrolled"),
        Column("controlled"),
        Column("within", "within windows"),
        Column("share", "beyond threshold"),
        Column("shift", "moved by"),
        Column("interval", "95 %"),
        Column("verdict", "the right way"),
        Column("windows"),
        Column("fewest", "fewest"),
        Column("paper", "paper"),
    ]
    return format_table(lines, columns, style)


def change_table(changes: Sequence[Change], style: Style) -> str:
    """What the schedule does to each quantity, first half and second."""
    lines = []
    for change in changes:
        halves, free = (
            " → ".join(f"{100 * value:.1f}" for value in pair)
            for pair in (change.halves, change.free_halves)
        )
        lines.append(
            {
                "quantity": f"{change.quantity}, {unit_of(change.quantity)}",
                "stage": change.stage,
                "uncontrolled": free,
                "controlled": halves,
                "moved by": f"{100 * change.shift.value:.1f}",
                "95 %": _interval(change.shift),
                "the right way": change.shift.verdict,
            }
        )
    return format_table(lines, style=style)


def windows_text(halves: tuple[Windows, Windows]) -> str:
    """How many windows the schedule leaves."""
    parts = [
        f"{where}: {windows.mean:.0f} windows (fewest: {windows.fewest})"
        for where, windows in zip((SLOW_AND_LOW, FAST_AND_HIGH), halves, strict=True)
    ]
    return "; ".join(parts)


def _cell(spread: Spread) -> str:
    return f"{100 * spread.mean:.1f} ({100 * spread.deviation:.1f})"


def _percent(spread: Spread) -> str:
    return f"{100 * spread.share:.0f} %"


def unit_of(quantity: str) -> str:
    """The unit of a quantity's hundredth."""
    return f"c{QUANTITIES[quantity].unit}"


def _interval(shift: Shift) -> str | None:
    if shift.interval is None:
        return None
    low, high = shift.interval
    return f"{100 * low:.1f} to {100 * high:.1f}"
