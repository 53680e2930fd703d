"""What only shows when all recordings of a corpus are known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cospeech.doctor.examination import Examination
from cospeech.doctor.findings import Check, Finding, Severity
from cospeech.doctor.lengths import check_clock
from cospeech.doctor.splits import check_content, check_ids, check_spans, check_speakers
from cospeech.doctor.transcript import find_owner, owner_finding

MOST_DOUBTS = 200
"""Transcripts that don't fit whose owner is looked for: each is tried on all recordings."""

EXPLAINED = (Check.TRANSCRIPT, Check.WORD_TIMES, Check.DRIFT)
"""Findings about words that are those of another recording."""

MOSTLY_TRANSCRIBED = 0.8
"""Share of recordings with a transcript from which one without is told of."""


def compare(examinations: Sequence[Examination], by_speakers: bool = False) -> list[Finding]:
    """All findings about a corpus: those of its recordings, and those that need several.

    Args:
        examinations: One per recording, in their order.
        by_speakers: Whether held-out splits are meant to hold speakers that never train.
    """
    traces = [examination.traces for examination in examinations]
    owners = _find_owners(examinations)
    findings: list[Finding] = []
    for i, examination in enumerate(examinations):
        own = examination.findings
        if i in owners:
            # Words of another recording also end elsewhere, and may seem to drift.
            words = examination.traces.files.words
            own = [f for f in own if f.file != words or f.check not in EXPLAINED]
            own = [*own, owners[i]]
        findings += own
    lengths = [(trace.lengths, trace.files) for trace in traces if trace.lengths is not None]
    clock = list(check_clock(lengths))
    if clock:
        findings = [finding for finding in findings if not _is_of_lengths(finding)]
    findings += clock
    findings += _without_transcript(examinations)
    for check in (check_ids, check_spans, check_content):
        findings += check(traces)
    if by_speakers:
        findings += check_speakers(traces)
    return findings


def _is_of_lengths(finding: Finding) -> bool:
    """Whether a clock that is wrong in the whole corpus explains it."""
    return finding.check is Check.LENGTHS or (
        finding.check is Check.DRIFT and finding.time_s is not None
    )


def _find_owners(examinations: Sequence[Examination]) -> dict[int, Finding]:
    transcripts = [
        (i, examination.traces.files.words, examination.traces.words)
        for i, examination in enumerate(examinations)
        if examination.traces.words is not None
    ]
    doubtful = [i for i, examined in enumerate(examinations) if examined.traces.doubt is not None]
    owners = {}
    for i in doubtful[:MOST_DOUBTS]:
        traces = examinations[i].traces
        assert traces.doubt is not None
        others = [(name, words) for j, name, words in transcripts if j != i]
        owner = find_owner(traces.doubt, others)
        if owner is not None:
            owners[i] = owner_finding(traces.files, *owner, traces.doubt.fit)
    return owners


def _without_transcript(examinations: Sequence[Examination]) -> Iterator[Finding]:
    without = [e for e in examinations if e.traces.words is None and not _is_empty(e)]
    if len(without) > (1 - MOSTLY_TRANSCRIBED) * len(examinations):
        return
    for examination in without:
        yield Finding(
            Check.MISSING,
            Severity.WARNING,
            examination.traces.files.audio,
            f"recording {examination.traces.id} has no transcript, most others have one",
            "add the transcript under the same name, or train without words",
        )


def _is_empty(examination: Examination) -> bool:
    """Whether there is a transcript without a word, which has a finding of its own."""
    return any(f.check is Check.WORD_TIMES for f in examination.findings)
