"""The study's numbers as tables and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from cospeech.reporting.markup import markdown
from cospeech.reporting.tables import Column, format_table
from cospeech.studies.caused_gestures.measuring import (
    LAGS_S,
    LONG_S,
    Number,
    SystemNumbers,
)

Style = Literal["text", "markdown"]

_ANSWERS = (
    Column("system", " "),
    Column("seeds"),
    Column("known", "word strokes"),
    Column("concept_share", "concept recognised, %"),
    Column("concept_share_by_luck", "by luck, %"),
    Column("concept_place", "its place"),
    Column("words_answered", "words answered"),
    Column("beats", "beats"),
    Column("beats_answered", "beats answered"),
    Column("beats_met", "beats met, %"),
    Column("beats_met_by_chance", "by chance, %"),
    Column("beats_lift", "over chance"),
    Column("beats_lag_s", "lag, s"),
)
_POSES = (
    Column("system", " "),
    Column("long", "long takes"),
    Column("first_quarter", "distance, first quarter"),
    Column("last_quarter", "last quarter"),
    Column("drift", "drift"),
    Column("takes"),
    Column("speed", "speed, %"),
    Column("spread", "spread, %"),
)
_DIFFERENCES = (
    Column("system", " "),
    Column("concept_share", "concept recognised, %"),
    Column("concept_place", "its place"),
    Column("words_answered", "words answered"),
    Column("beats_answered", "beats answered"),
    Column("beats_lift", "beats met, over chance"),
    Column("drift", "drift"),
    Column("speed", "speed, %"),
    Column("spread", "spread, %"),
)
_PERCENT = frozenset(
    ("concept_share", "concept_share_by_luck", "beats_met", "beats_met_by_chance")
) | {"speed", "spread"}
_PLAIN = frozenset(("concept_share_by_luck", "beats_met", "beats_met_by_chance"))
"""What is shown without its interval: it only says how to read the number beside it."""

_COUNTS = frozenset(("known", "beats", "long", "takes"))


def tables(systems: Sequence[SystemNumbers], concepts: int, style: Style) -> str:
    """Answers, poses, differences, and how to read them.

    Args:
        systems: References first.
        concepts: How many concepts there are to choose from.
        style: As for `format_table`.
    """
    shown = [
        format_table([_row(system, _ANSWERS) for system in systems], _ANSWERS, style),
        format_table([_row(system, _POSES) for system in systems], _POSES, style),
    ]
    trained = [system for system in systems if system.seeds]
    if len(trained) > 1:
        rows = [_difference(system, trained[0]) for system in trained[1:]]
        columns = (Column("system", f"minus {trained[0].name}"), *_DIFFERENCES[1:])
        shown.append(format_table(rows, columns, style))
    notes = _notes(systems, concepts)
    if style == "markdown":
        notes = [f"* {markdown(note)}" for note in notes]
    return "\n\n".join([*shown, "\n".join(notes)])


def _notes(systems: Sequence[SystemNumbers], concepts: int) -> list[str]:
    counts = systems[0].counts
    notes = [
        "Recorded motion is the most that can be had; mismatched speech (motion of other takes of"
        " the same speaker) and the mean pose are what knowing nothing gives.",
        f"Concept recognised: which of {concepts} concepts a stroke's wrist movement is likest to;"
        " by luck: the concepts of the same take's other strokes. Its place: share of the other"
        " concepts that are less like it (0.5 is luck).",
        "Answered: share of the steps between strokes that are slower than those of a stroke (0.5"
        " is luck). Met: a peak of the wrists' speed within 0.2 s of the beat's middle; by chance:"
        " of the beats shifted around; over chance: 0 is as many, 1 is all. Lag: where wrists are"
        " fastest, seconds after the recorded beats.",
        f"Distance: to the training poses' mean, in their deviations. Long takes: of {LONG_S:g} s"
        " of gesturing and more. Speed of the wrists and spread of the poses within a take: of"
        " recorded motion's.",
        f"In brackets: 95 % over the {counts['takes']} takes; with several seeds, after the"
        " semicolon, 95 % of their mean by Student's t.",
    ]
    if counts["known"] < counts["words"]:
        notes.append(
            f"{counts['words'] - counts['known']} of {counts['words']} strokes of words are of"
            " concepts that the training part lacks: answered or not, but never recognised."
        )
    return notes


def as_json(systems: Sequence[SystemNumbers]) -> dict[str, Any]:
    """Every number, in SI units and shares, and the lags of the profiles."""
    return {
        "lags_s": list(LAGS_S),
        "systems": [
            {
                "name": system.name,
                "seeds": list(system.seeds),
                "counts": system.counts,
                "numbers": {
                    key: {
                        "value": number.value,
                        "interval": number.interval,
                        "by_seed": list(number.by_seed),
                        "seeds_interval": number.seeds_interval,
                    }
                    for key, number in system.numbers.items()
                },
                "beats_profile": system.profile.tolist(),
            }
            for system in systems
        ],
    }


def _row(system: SystemNumbers, columns: Sequence[Column]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "system": system.name,
        "seeds": ", ".join(map(str, system.seeds)) or None,
    }
    for column in columns:
        if column.key in _COUNTS:
            row[column.key] = system.counts[column.key]
        elif column.key in system.numbers:
            row[column.key] = _cell(column.key, system.numbers[column.key], False)
    return row


def _difference(system: SystemNumbers, first: SystemNumbers) -> Mapping[str, Any]:
    return {
        "system": system.name,
        **{
            column.key: _cell(
                column.key, system.numbers[column.key].minus(first.numbers[column.key]), True
            )
            for column in _DIFFERENCES[1:]
        },
    }


def _cell(key: str, number: Number, signed: bool) -> str | None:
    if not np.isfinite(number.value):
        return None
    scale, decimals = (100, 0) if key in _PERCENT else (1, 2)
    sign = "+" if signed or key in ("beats_lag_s", "drift") else ""

    def text(value: float) -> str:
        return f"{scale * value:{sign}.{decimals}f}"

    intervals = [
        " to ".join(map(text, interval))
        for interval in (number.interval, number.seeds_interval)
        if interval is not None
    ]
    if key in _PLAIN or not intervals:
        return text(number.value)
    return f"{text(number.value)} ({'; '.join(intervals)})"
