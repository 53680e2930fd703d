"""The study's numbers as tables and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

from cospeech.metrics.beat_consistency import BeatConsistency, DirectedConsistency
from cospeech.reporting.markup import markdown
from cospeech.reporting.tables import Column, format_table, format_value
from cospeech.studies.synchrony.picture import DIRECTIONS
from cospeech.studies.synchrony.rows import LAGS_S, SynchronyRow

_COLUMNS = (
    Column("system", " "),
    Column("fgd", "FGD (95 %)", "lower"),
    Column("audio_to_motion", "lift audio → motion (95 %)"),
    Column("motion_to_audio", "lift motion → audio (95 %)"),
    Column("beats", "motion beats/s"),
    Column("seam", "seam ratio"),
    Column("jitter", "jitter, %"),
    Column("speed", "wrists, cm/s"),
)
_BEAT_COLUMNS = (
    Column("system", " "),
    Column("direction", " "),
    Column("raw", "raw score"),
    Column("chance", "chance"),
    Column("lift", "lift (95 %)"),
    Column("p", "p"),
    Column("none", "lift without lag (95 %)"),
)


def tables(
    rows: Sequence[SynchronyRow], facts: Mapping[str, Any], style: Literal["text", "markdown"]
) -> str:
    """Both tables and how to read them.

    Args:
        rows: Recorded motion first.
        facts: ``lag_s``, ``lag_from_training_part``, ``detectors`` and ``encoder`` of the JSON.
        style: As for `format_table`.
    """
    main = format_table([_main(row) for row in rows], _COLUMNS, style)
    beats = format_table(
        [_beats(row, direction) for row in rows for direction in DIRECTIONS], _BEAT_COLUMNS, style
    )
    found = rows[0].at_lag
    where = (
        "where recorded training motion is most consistent"
        if facts["lag_from_training_part"]
        else "as given"
    )
    notes = [
        f"{found.recordings} recordings, {found.audio_beats_per_second:.2f} beats of speech per"
        f" second; speech taken to follow motion by {found.lag_s:g} s, {where}.",
        "Lift: (score - chance) / (1 - chance); chance is the score with the speech shifted around."
        " Nearer to recorded motion's is better.",
        "Recorded motion's FGD is that between its halves. Seam ratio: step every 8 frames over"
        " steps elsewhere.",
        f"Detectors: {facts['detectors']['motion']}; {facts['detectors']['audio']}.",
        f"FGD encoder: {facts['encoder']['source']}, {facts['encoder']['sha256'][:12]}.",
    ]
    notes += [
        f"{row.name}: {row.at_lag.clips_without_motion_beats} of {row.at_lag.clips} clips without"
        f" motion beats, {row.at_lag.clips_without_audio_beats} without beats of speech."
        for row in rows
        if row.at_lag.clips_without_motion_beats or row.at_lag.clips_without_audio_beats
    ]
    if style == "markdown":
        notes = [f"* {markdown(note)}" for note in notes]
    return "\n\n".join([main, beats, "\n".join(notes)])


def as_json(rows: Sequence[SynchronyRow]) -> dict[str, Any]:
    """Every number, in SI units, and the lags of the profiles."""
    return {"lags_s": list(LAGS_S), "rows": [_row_as_json(row) for row in rows]}


def _main(row: SynchronyRow) -> dict[str, str | None]:
    values: dict[str, str | None] = {
        "system": row.name,
        "fgd": _fgd(row.fgd),
        "beats": f"{row.at_lag.motion_beats_per_second:.2f}",
    }
    for direction in DIRECTIONS:
        values[direction] = _lift(getattr(row.at_lag, direction))
    if row.moving is not None:
        seam, jitter = row.moving.seam_ratio, row.moving.jitter_share
        values["seam"] = None if seam is None else f"{seam:.2f}"
        values["jitter"] = None if jitter is None else f"{100 * jitter:.1f}"
        values["speed"] = f"{100 * row.moving.wrist_speed:.1f}"
    return values


def _beats(row: SynchronyRow, direction: str) -> dict[str, str]:
    found: DirectedConsistency = getattr(row.at_lag, direction)
    return {
        "system": row.name,
        "direction": DIRECTIONS[direction],
        "raw": f"{found.score:.3f}",
        "chance": f"{found.chance:.3f}",
        "lift": _lift(found),
        "p": f"{found.p_value:.2f}",
        "none": _lift(getattr(row.at_none, direction)),
    }


def _lift(found: DirectedConsistency) -> str:
    if found.interval is None:
        return f"{found.lift.value:+.3f}"
    low, high = found.interval
    return f"{found.lift.value:+.3f} ({low:+.3f} to {high:+.3f})"


def _fgd(values: Mapping[str, float] | None) -> str | None:
    if values is None:
        return None
    low, high = values.get("fgd_low"), values.get("fgd_high")
    if low is None or high is None:
        return format_value(values["fgd"])
    return f"{format_value(values['fgd'])} ({format_value(low)} to {format_value(high)})"


def _row_as_json(row: SynchronyRow) -> dict[str, Any]:
    return {
        "name": row.name,
        "beat_consistency": _consistency_as_json(row.at_lag),
        "beat_consistency_without_lag": _consistency_as_json(row.at_none),
        "lift_profile": {
            direction: row.profile[:, column].tolist()
            for column, direction in enumerate(DIRECTIONS)
        },
        "fgd": row.fgd,
        "motion": None if row.moving is None else asdict(row.moving),
    }


def _consistency_as_json(found: BeatConsistency) -> dict[str, Any]:
    values: dict[str, Any] = {
        key: value for key, value in vars(found).items() if key not in DIRECTIONS
    }
    for direction in DIRECTIONS:
        directed: DirectedConsistency = getattr(found, direction)
        values[direction] = {
            "score": directed.score,
            "chance": directed.chance,
            "lift": directed.lift.value,
            "interval": directed.interval,
            "p_value": directed.p_value,
        }
    return values
