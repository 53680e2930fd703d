"""Tables of the corpus report: unusual recordings, joints, words, speakers."""

from __future__ import annotations

import numpy as np

from cospeech.corpus.store import Store
from cospeech.reporting.corpus_report.charts import (
    range_bar,
)
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
from cospeech.reporting.markup import escaped
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
    head = (
        '<tr><th>recording</th><th>speaker, split</th><th>what</th><th class="number">value</th>'
        '<th class="number">middle half</th></tr>'
    )
    parts = [f"<table class='dense'>{head}{''.join(rows[:_SHOWN_UNUSUAL])}</table>"]
    if len(rows) > _SHOWN_UNUSUAL:
        more = f"{len(found) - _SHOWN_UNUSUAL:,} more"
        if len(found) > _MOST_UNUSUAL:
            more += f", the {_MOST_UNUSUAL - _SHOWN_UNUSUAL} farthest"
        parts.append(
            f"<details><summary>{more}</summary>"
            f"<table class='dense'>{head}{''.join(rows[_SHOWN_UNUSUAL:])}</table></details>"
        )
    return f"<section>{''.join(parts)}</section>{note}"


def _unusual_row(store: Store, one: Unusual, split: str) -> str:
    stored = store.recordings[one.recording]
    unit = f" {one.measure.unit}" if one.measure.unit else ""
    usual = MISSING
    if one.fences is not None:
        low, high = one.fences.quartiles
        usual = f"{short(low)} to {short(high)}{unit}"
    what = one.measure.title + (f"<small>{escaped(one.note)}</small>" if one.note else "")
    return (
        f"<tr><td><code>{escaped(stored.id)}</code></td>"
        f"<td>{escaped(stored.speaker)}<small>{escaped(split)}</small></td>"
        f'<td>{what}</td><td class="number flag">{short(one.value)}{unit}</td>'
        f'<td class="number">{usual}</td></tr>'
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
    rows: dict[bool, list[str]] = {False: [], True: []}
    for j, joint in enumerate(skeleton.joints):
        style = side_of(joint) or "bar"
        bone = [MISSING] * 3
        if skeleton.parents[j] >= 0 and lengths[j] > 0:
            bone = [
                _flagged(short(lengths[j]), solid and j in lopsided),
                _flagged(f"{100 * within[j]:.1f} %", solid and within[j] > _STRETCHING),
                f"{100 * between[j]:.1f} %",
            ]
        cells = [short(medians[j]), short(ends[j])]
        rows[says(joint, FINGER)].append(
            f"<tr><td>{escaped(joint)}</td>"
            f"<td>{range_bar(medians[j], ends[j], float(ends.max()), style)}</td>"
            + "".join(f'<td class="number">{cell}</td>' for cell in cells)
            + f"<td>{range_bar(lengths[j], lengths[j], float(lengths.max()), style)}</td>"
            + "".join(f'<td class="number">{cell}</td>' for cell in bone)
            + "</tr>"
        )
    unit = f"{length_unit}/s"
    head = (
        f'<tr><th>joint</th><th>speed</th><th class="number">median, {unit}</th>'
        f'<th class="number">95 %, {unit}</th><th>bone</th>'
        f'<th class="number">mean, {length_unit}</th><th class="number">varies within</th>'
        '<th class="number">between</th></tr>'
    )
    fingers = (
        f"<details><summary>{len(rows[True])} finger joints</summary>"
        f"<table class='dense'>{head}{''.join(rows[True])}</table></details>"
        if rows[True]
        else ""
    )
    return (
        f"<section><h3>{escaped(skeleton.name)}<small>{len(skeleton)} joints,"
        f" {totals.recordings:,} recordings, {totals.frames:,} frames looked at</small></h3>"
        f"<table class='dense'>{head}{''.join(rows[False])}</table>{fingers}</section>"
    )


def _flagged(text: str, flag: bool) -> str:
    return f'<span class="flag">{text}</span>' if flag else text


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
        cells = [
            f"{speaker.recordings:,}",
            f"{speaker.minutes:.1f}",
            *(
                f"{value:.{decimals}f}" if np.isfinite(value) else MISSING
                for value, decimals in (
                    (speaker.words_per_minute, 0),
                    (left, 1),
                    (right, 1),
                )
            ),
        ]
        rows.append(
            f"<tr><td>{escaped(speaker.name)}</td>"
            f"<td>{escaped(', '.join(speaker.splits)) or MISSING}</td>"
            f"<td>{range_bar(speaker.minutes, speaker.minutes, most, 'bar')}</td>"
            + "".join(f'<td class="number">{cell}</td>' for cell in cells)
            + "</tr>"
        )
    head = (
        '<tr><th>speaker</th><th>splits</th><th></th><th class="number">recordings</th>'
        '<th class="number">minutes</th><th class="number">words/min</th>'
        f'<th class="number">left wrist, {unit}</th>'
        f'<th class="number">right wrist, {unit}</th></tr>'
    )
    shown = f"<table class='dense'>{head}{''.join(rows[:_SHOWN_SPEAKERS])}</table>"
    if len(rows) > _SHOWN_SPEAKERS:
        count = len(statistics.speakers) - _SHOWN_SPEAKERS
        shown += (
            f"<details><summary>{count:,} more speakers</summary>"
            f"<table class='dense'>{head}{''.join(rows[_SHOWN_SPEAKERS:])}</table></details>"
        )
    return f"<section>{shown}</section>"
