"""The same seconds, recordings or speakers in two splits."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.examination import Traces
from cospeech.doctor.findings import Check, Finding, Severity

SHARED_LANDMARKS = 4
"""Landmarks (see `cospeech.doctor.fingerprints`) that two recordings share by more than chance:
about three seconds of the same samples. Recordings with fewer must share all, and at least two."""

MOST_COMMON = 20
"""A landmark in more recordings than this is a jingle or a rest pose, and says nothing."""

HELD_OUT = ("val", "test")


def check_ids(traces: Sequence[Traces]) -> Iterator[Finding]:
    """Recordings with one id."""
    by_id: dict[str, list[Traces]] = defaultdict(list)
    for trace in traces:
        by_id[trace.id].append(trace)
    for name, same in by_id.items():
        if len(same) > 1:
            yield Finding(
                Check.DUPLICATE,
                Severity.ERROR,
                same[1].files.motion,
                f"{len(same)} recordings are called {name}; another is {same[0].files.motion}",
                "rename one, or take one of two copies of the corpus away",
            )


def check_spans(traces: Sequence[Traces]) -> Iterator[Finding]:
    """Parts of one recording that are in two splits and overlap in time."""
    for trace in traces:
        for (one, a, b), (two, c, d) in combinations(trace.parts, 2):
            start, stop = max(a, c), min(b, d)
            if one != two and stop - start > 1e-6:
                yield Finding(
                    Check.OVERLAP,
                    Severity.ERROR,
                    trace.files.motion,
                    f"{start:.2f} to {stop:.2f} s of recording {trace.id} are in {one} and in"
                    f" {two}",
                    "keep the recording in one split, or cut it into blocks that don't overlap",
                    time_s=start,
                )


def check_content(traces: Sequence[Traces]) -> Iterator[Finding]:
    """The same audio or motion in two recordings.

    Any shared stretch is an error across splits. Within a split only whole copies are told of:
    published sets cut overlapping windows from one video.
    """
    shared: dict[tuple[int, int], dict[str, list[tuple[float, float]]]] = defaultdict(
        lambda: defaultdict(list)
    )
    for kind in ("audio", "motion"):
        places: dict[int, list[tuple[int, float]]] = defaultdict(list)
        for i, trace in enumerate(traces):
            prints = getattr(trace, kind)
            for value, time in zip(prints.hashes.tolist(), prints.times.tolist(), strict=True):
                places[value].append((i, time))
        for found in places.values():
            if not 1 < len(found) <= MOST_COMMON:
                continue
            for (i, time), (j, other) in combinations(found, 2):
                if i != j:
                    shared[i, j][kind].append((time, other))
    for (i, j), kinds in sorted(shared.items()):
        one, two = traces[i], traces[j]
        common = {
            kind: np.array(sorted(times))
            for kind, times in kinds.items()
            if len(times) >= _enough(len(getattr(one, kind).hashes), len(getattr(two, kind).hashes))
        }
        if common:
            yield from _content_findings(one, two, common)


def check_speakers(traces: Sequence[Traces]) -> Iterator[Finding]:
    """Speakers of held-out splits who also train, where the split is by speakers."""
    training = {trace.speaker for trace in traces for part in trace.parts if part[0] == "train"}
    seen = set()
    for trace in traces:
        for split, _, _ in trace.parts:
            known = (trace.speaker, split)
            if split in HELD_OUT and trace.speaker in training and known not in seen:
                seen.add(known)
                yield Finding(
                    Check.OVERLAP,
                    Severity.ERROR,
                    trace.files.motion,
                    f"speaker {trace.speaker!r} is in train and, with recording {trace.id}, in"
                    f" {split}, though the split is by speakers",
                    "move all of a speaker's recordings into one split; is the speaker's name"
                    " read rightly from the file names?",
                )


def _enough(one: int, two: int) -> int:
    return max(2, min(SHARED_LANDMARKS, one, two))


def _content_findings(
    one: Traces, two: Traces, common: dict[str, NDArray[np.float64]]
) -> Iterator[Finding]:
    pairs = {
        (a, b)
        for times in common.values()
        for first, second in times
        for a in _splits_at(one, first)
        for b in _splits_at(two, second)
        if a != b
    }
    what, times = max(common.items(), key=lambda item: len(item[1]))
    if not pairs and not all(_is_copy(one, two, kind, common[kind]) for kind in common):
        return
    first, last = float(times[:, 0].min()), float(times[:, 0].max())
    names = [t.files.audio if what == "audio" else t.files.motion for t in (one, two)]
    same = (
        f"the same {' and '.join(common)} are in {one.id} ({first:.1f} to {last:.1f} s) and in"
        f" {two.id} (from {times[:, 1].min():.1f} s; {names[1]})"
    )
    if not pairs:
        yield Finding(
            Check.DUPLICATE,
            Severity.WARNING,
            names[0],
            same,
            "leave one of the two out, and split so that both are on one side",
            time_s=first,
        )
        return
    splits = ", ".join(f"{a} and {b}" for a, b in sorted(pairs))
    yield Finding(
        Check.OVERLAP,
        Severity.ERROR,
        names[0],
        f"{same}, which are in different splits: {splits}",
        "put both in one split, or leave one out: what is tested must not be trained on",
        time_s=first,
    )


def _is_copy(one: Traces, two: Traces, kind: str, times: NDArray[np.float64]) -> bool:
    counts = [len(getattr(trace, kind).hashes) for trace in (one, two)]
    aligned = np.abs(times[:, 0] - times[:, 1]) < 0.1
    return bool(aligned.all()) and len(times) >= 0.9 * max(counts)


def _splits_at(trace: Traces, time_s: float) -> set[str]:
    return {split for split, start, stop in trace.parts if start <= time_s <= stop}
