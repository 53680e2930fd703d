"""What the doctor calls an error of body or sound is not kept in a corpus that is prepared."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from cospeech.corpus.recording import Recording, Remark
from cospeech.corpus.source import Dropped, Source
from cospeech.doctor.audio import check_signal
from cospeech.doctor.body import find_body
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.posture import check_units, check_vertical

TOLERATED = (Check.CLIPPED,)
"""Errors that features of loudness feel and a corpus may have: they are counted."""


def examined_source(source: Source) -> Source:
    """A source without the recordings whose body or sound the doctor calls wrong.

    They are dropped as faults, in the doctor's words. What else it says of body and sound becomes
    remarks.

    Args:
        source: Of recordings in three dimensions.
    """
    return replace(source, read=functools.partial(_examined, source.read))


def _examined(
    read: Callable[[], Iterable[Recording | Dropped]],
) -> Iterator[Recording | Dropped]:
    for item in read():
        yield item if isinstance(item, Dropped) else _judged(item)


def _judged(recording: Recording) -> Recording | Dropped:
    findings = list(check_body_and_sound(recording))
    for finding in findings:
        if finding.severity is Severity.ERROR and finding.check not in TOLERATED:
            reason = f"{finding.file}: {finding.problem}\n  -> {finding.next_step}"
            words = tuple(word.text for word in recording.speech.words or ())
            return Dropped(recording.id, reason, finding.check, is_fault=True, words=words)
    more = [Remark(finding.check, finding.problem, finding.next_step) for finding in findings]
    return replace(recording, remarks=(*recording.remarks, *more))


def check_body_and_sound(recording: Recording) -> Iterator[Finding]:
    """Size and vertical of the body, and whether the sound is one."""
    files = Files.all_in(recording.source or recording.id)
    if recording.motion.first_bad_frame() is None:
        body = find_body(recording.motion)
        if body is not None:
            yield from check_units(body, files)
            yield from check_vertical(body, files) if body.scale > 0 else ()
    if not recording.annotations.get("silent"):
        is_dialogue = recording.interlocutor is not None
        yield from check_signal(recording.speech.waveform, files, is_dialogue)
