"""Tables of the corpus report: unusual recordings, joints, words, speakers."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from cospeech.corpus.store import Store
from cospeech.reporting.corpus_report.charts import flagged, range_bar
from cospeech.reporting.corpus_report.statistics import MOST_FRAMES
from cospeech.reporting.corpus_report.totals import CorpusStatistics, JointTotals
from cospeech.reporting.corpus_report.unusual import (
    FENCE,
    FEWEST,
    Unusual,
    short,
    unusual,
)
from cospeech.reporting.joint_names import FINGER, says, side_of
from cospeech.reporting.markup import escaped, html_table
from cospeech.reporting.tables import MISSING

_SHOWN_UNUSUAL, _MOST_UNUSUAL = 15, 300
_SHOWN_SPEAKERS, _MOST_SPEAKERS = 12, 2000
_MOST_SKELETONS = 4
_STRETCHING = 0.05
_LOPSIDED = 0.1


def unusual_section(store: Store, statistics: CorpusStatistics) -> str:
    """Numbers of single recordings that are far from the corpus' own, farthest first."""
    found = unusual(statistics.measures, store.dimensions)
    rule = (
        f"A number stands apart when it is more than {FENCE:g} inter-quartile ranges outside the"
        " middle half of the recordings (ratios for lengths and speeds). Also listed: silent or"
        " clipped audio, audio and motion that differ by over 0.5 s, wrists that never move,"
        " transcripts without words."
    )
    if len(store.recordings) < FEWEST:
        rule += f" With fewer than {FEWEST} recordings only the latter can be said."
    note = f'<p class="muted">{rule}</p>'
    if not found:
        return f"<section>None.</section>{note}"
    names = _split_names(store)
    rows = [_unusual_row(store, one, names[one.recording]) for one in found[:_MOST_UNUSUAL]]
    heads = ["recording", "speaker, split", "what", "value", "middle half"]
    more = f"{len(found) - _SHOWN_UNUSUAL:,} more"
    if len(found) > _MOST_UNUSUAL:
        more += f", the {_MOST_UNUSUAL - _SHOWN_UNUSUAL} farthest"
    table = _dense(heads, rows[:_SHOWN_UNUSUAL], (3, 4), more, rows[_SHOWN_UNUSUAL:])
    return f"<section>{table}</section>{note}"


def _dense(
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    numbers: Collection[int],
    more: str,
    others: Sequence[Sequence[str]],
) -> str:
    """A table, and one of the other rows that opens at what ``more`` says."""
    table = html_table(heads, rows, numbers, "dense")
    if not others:
        return table
    hidden = html_table(heads, others, numbers, "dense")
    return f"{table}<details><summary>{more}</summary>{hidden}</details>"


def _unusual_row(store: Store, one: Unusual, split: str) -> tuple[str, ...]:
    stored = store.recordings[one.recording]
    unit = f" {one.measure.unit}" if one.measure.unit else ""
    usual = MISSING
    if one.fences is not None:
        low, high = one.fences.quartiles
        usual = f"{short(low)} to {short(high)}{unit}"
    what = one.measure.title + (f"<small>{escaped(one.note)}</small>" if one.note else "")
    return (
        f"<code>{escaped(stored.id)}</code>",
        f"{escaped(stored.speaker)}<small>{escaped(split)}</small>",
        what,
        flagged(f"{short(one.value)}{unit}", True),
        usual,
    )


def _split_names(store: Store) -> list[str]:
    found: list[list[str]] = [[] for _ in store.recordings]
    for name, spans in store.splits.items():
        for span in spans:
            if name not in found[span.recording]:
                found[span.recording].append(name)
    return [", ".join(names) or "in no split" for names in found]


def joints_section(store: Store, statistics: CorpusStatistics) -> str:
    """Per joint: speeds, and the length of the bone from its parent."""
    order = sorted(range(len(statistics.joints)), key=lambda i: -statistics.joints[i].frames)
    order = [i for i in order if statistics.joints[i].frames]
    parts = [_joint_table(store, i, statistics.joints[i]) for i in order[:_MOST_SKELETONS]]
    if len(order) > _MOST_SKELETONS:
        parts.append(f"<p>{len(order) - _MOST_SKELETONS} rarer skeletons are not shown.</p>")
    expected = (
        " It should hardly vary within a recording of motion capture, and by a few per cent where"
        " poses were estimated from video; between recordings it is the difference of people."
        f" Coloured: over {100 * _STRETCHING:g} % within recordings, or a length that differs from"
        f" the other side's by more than {100 * _LOPSIDED:g} %."
        if store.dimensions == 3
        else " In a picture bones shorten as they turn away, so it varies with the gestures."
    )
    return "".join(parts) + (
        '<p class="muted">Speeds over about 1/15 s in the space of the data, the body\'s travel'
        " included (dot: median, bar: up to the 95th percentile). Bone: distance from the parent"
        " joint, with its coefficient of variation within and between recordings."
        f"{expected} At most {MOST_FRAMES:,} frames per recording are looked at, evenly spaced.</p>"
    )


def _joint_table(store: Store, skeleton_index: int, totals: JointTotals) -> str:
    skeleton = store.skeletons[skeleton_index]
    solid = store.dimensions == 3
    length_unit, factor = ("cm", 100.0) if solid else ("px", 1.0)
    medians, ends = (np.nan_to_num(totals.speeds.quantile(q)) * factor for q in (0.5, 0.95))
    lengths = totals.bone_lengths * factor
    within, between = totals.bone_variation_within, totals.bone_variation_between
    lopsided: set[int] = set()
    for pair in skeleton.mirror_pairs:
        low, high = sorted(lengths[list(pair)])
        if high - low > _LOPSIDED * high:
            lopsided.update(pair)
    rows: dict[bool, list[Sequence[str]]] = {False: [], True: []}
    for j, joint in enumerate(skeleton.joints):
        style = side_of(joint) or "bar"
        bone = [MISSING] * 3
        if skeleton.parents[j] >= 0 and lengths[j] > 0:
            bone = [
                flagged(short(lengths[j]), solid and j in lopsided),
                flagged(f"{100 * within[j]:.1f} %", solid and within[j] > _STRETCHING),
                f"{100 * between[j]:.1f} %",
            ]
        speed_bar = range_bar(medians[j], ends[j], float(ends.max()), style)
        bone_bar = range_bar(lengths[j], lengths[j], float(lengths.max()), style)
        rows[says(joint, FINGER)].append(
            [escaped(joint), speed_bar, short(medians[j]), short(ends[j]), bone_bar, *bone]
        )
    speeds = [f"median, {length_unit}/s", f"95 %, {length_unit}/s"]
    bones = [f"mean, {length_unit}", "varies within", "between"]
    heads = ["joint", "speed", *speeds, "bone", *bones]
    more = f"{len(rows[True])} finger joints"
    return (
        f"<section><h3>{escaped(skeleton.name)}<small>{len(skeleton)} joints,"
        f" {totals.recordings:,} recordings, {totals.frames:,} frames looked at</small></h3>"
        f"{_dense(heads, rows[False], (2, 3, 5, 6, 7), more, rows[True])}</section>"
    )


def words_section(store: Store, statistics: CorpusStatistics) -> str:
    """The most frequent words, and how many occur once."""
    counts = statistics.word_counts
    total = int(counts.sum())
    if not total:
        return "<section>No recording has a transcript with words.</section>"
    order = np.argsort(-counts, kind="stable")
    order = order[counts[order] > 0]
    often = ", ".join(
        f"{escaped(store.vocabulary[int(i)])}&nbsp;<small class='inline muted'>"
        f"{counts[i]:,}</small>"
        for i in order[:40]
    )
    once = order[counts[order] == 1]
    rare = ", ".join(
        escaped(store.vocabulary[int(i)]) for i in once[:: max(1, len(once) // 30)][:30]
    )
    transcribed = int(np.isfinite(statistics.measures["words_per_minute"]).sum())
    return (
        f"<section><p><b>Most frequent:</b> {often}</p>"
        + (f"<p><b>Once only</b> ({len(once):,} words), for example: {rare}</p>" if rare else "")
        + f"</section><p class='muted'>{transcribed:,} of {len(store.recordings):,} recordings have"
        " a transcript.</p>"
    )


def speakers_section(store: Store, statistics: CorpusStatistics) -> str:
    """Minutes, pace and wrist speed of each speaker."""
    unit, factor = ("cm/s", 100.0) if store.dimensions == 3 else ("px/s", 1.0)
    most = max((s.minutes for s in statistics.speakers), default=0.0)
    rows = []
    for speaker in statistics.speakers[:_MOST_SPEAKERS]:
        left, right = (speed * factor for speed in speaker.wrist_speeds)
        measured = ((speaker.words_per_minute, 0), (left, 1), (right, 1))
        rows.append(
            [
                escaped(speaker.name),
                escaped(", ".join(speaker.splits)) or MISSING,
                range_bar(speaker.minutes, speaker.minutes, most, "bar"),
                f"{speaker.recordings:,}",
                f"{speaker.minutes:.1f}",
                *(f"{v:.{digits}f}" if np.isfinite(v) else MISSING for v, digits in measured),
            ]
        )
    heads = ["speaker", "splits", "", "recordings", "minutes", "words/min"]
    heads += [f"left wrist, {unit}", f"right wrist, {unit}"]
    more = f"{len(statistics.speakers) - _SHOWN_SPEAKERS:,} more speakers"
    shown, others = rows[:_SHOWN_SPEAKERS], rows[_SHOWN_SPEAKERS:]
    return f"<section>{_dense(heads, shown, range(3, 8), more, others)}</section>"
