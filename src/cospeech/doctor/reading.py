"""Examining what readers find: takes, sources, and recordings of a store."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from cospeech.corpus.recording import Recording, Remark
from cospeech.corpus.source import Dropped, Source, explained
from cospeech.corpus.store import Store
from cospeech.doctor.examination import SPREAD_TIMING, Examination, examine_closely
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.lengths import Lengths, check_lengths
from cospeech.doctor.words import check_words_end
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.mocap import ReadingSettings, Take, read_take
from cospeech.formats.mocap.side_files import first_usable
from cospeech.motion.bvh import read_bvh_timing
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.speech.audio import audio_seconds
from cospeech.speech.speech import Speech, Word
from cospeech.speech.transcript import read_transcript_with_timing

_log = logging.getLogger(__name__)
_TIME = re.compile(r"\bat ([0-9.]+) s\b")
_FRAME = re.compile(r"\bframe (\d+)\b")


@dataclass(frozen=True)
class StoredPart:
    """Some recordings of a store.

    Attributes:
        path: The store's folder.
        indices: Of the recordings.
    """

    path: str
    indices: tuple[int, ...]


@dataclass(frozen=True)
class Read:
    """What came of one take, source or part of a store.

    Attributes:
        examinations: One per recording.
        findings: About what gave no recording.
        left_out: Reason -> number of recordings that a rule of the corpus leaves out.
    """

    examinations: list[Examination] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)


def read(item: Take | Source | StoredPart, settings: ReadingSettings) -> Read:
    """Examine one item; whatever is wrong with it, expected or not, becomes a finding."""
    name = item.path if isinstance(item, StoredPart) else str(item.files[0] if item.files else item)
    try:
        if isinstance(item, Take):
            return read_one_take(item, settings)
        if isinstance(item, StoredPart):
            return read_stored(item)
        return read_source(item)
    except Exception as error:
        return Read(findings=[_unreadable(name, error)])


def read_one_take(take: Take, settings: ReadingSettings) -> Read:
    """Examine the files of a take, and the recording that is made of them.

    Readers cut audio, motion and words to one length; the lengths looked at here are those of the
    files.
    """
    files = _files(take, take.files)
    if take.left_out is not None:
        return Read(left_out=Counter([take.left_out]))
    findings = list(_missing(take))
    if take.motion is None or take.problem is not None:
        if not findings:
            findings = [_unreadable(files.motion, CospeechError(take.problem or "no motion"))]
        return Read(findings=findings)
    lengths = None
    if (measured := _lengths(take, settings)) is not None:
        sound, lengths = measured
        findings += check_lengths(lengths, replace(files, audio=str(sound)))
    try:
        recording = read_take(take, settings)
    except Exception as error:
        # Lengths that can't belong together are what the reader stops at.
        if not any(finding.check in (Check.LENGTHS, Check.DRIFT) for finding in findings):
            fps = settings.frame_rate or (lengths.fps if lengths else None)
            findings.append(_unreadable(files.motion, error, fps))
        return Read(findings=findings)
    findings += [
        _about_file(remark, remark.path) for remark in recording.remarks if remark.path is not None
    ]
    files = _files(take, recording.files)
    examination = examine_closely(recording, files, lengths)
    misplaced = {
        finding.check for finding in examination.findings if finding.file == files.words
    } & {Check.TRANSCRIPT, Check.DRIFT}
    if lengths is not None and recording.speech.words is not None and not misplaced:
        findings += _words_of_file(take, lengths.audio_s, files)
    return Read([replace(examination, findings=findings + examination.findings)])


def read_source(source: Source) -> Read:
    """Examine the recordings of a source."""
    result = Read()
    name = str(source.files[0]) if source.files else source.id
    try:
        for item in source.read():
            if isinstance(item, Recording):
                files = Files.all_in(f"{name} ({item.id})")
                result.examinations.append(examine_closely(item, files))
            elif item.is_fault:
                result.findings.append(_dropped(item, f"{name} ({item.id})"))
            else:
                result.left_out[item.kind] += 1
    except Exception as error:
        result.findings.append(_unreadable(f"{name} ({source.id})", error))
    return result


def read_stored(part: StoredPart) -> Read:
    """Examine recordings of a store."""
    store = _open_store(part.path)
    result = Read()
    parts: dict[int, list[tuple[str, float, float]]] = {index: [] for index in part.indices}
    for split, spans in store.splits.items():
        for span in spans:
            if span.recording in parts:
                times = (span.start / EVALUATION_FPS, span.stop / EVALUATION_FPS)
                parts[span.recording].append((split, *times))
    for index in part.indices:
        facts = store.recordings[index]
        waveform = store.read(index, "audio")[:, 0] * np.float32(1 / 32767)
        words = tuple(
            Word(store.vocabulary[int(word)], float(start), float(end))
            for start, end, word in store.words(index)
        )
        recording = Recording(
            facts.id,
            facts.speaker,
            Speech(waveform, words if facts.has_words else None),
            store.motion(index),
            annotations=store.annotations(index),
            split=facts.split,
            interlocutor=Speech(np.zeros(0, np.float32)) if facts.has_interlocutor else None,
        )
        files = Files.all_in(f"{part.path} ({facts.id})")
        result.examinations.append(examine_closely(recording, files, parts=tuple(parts[index])))
    return result


@lru_cache(maxsize=1)
def _open_store(path: str) -> Store:
    return Store(path)


def _files(take: Take, among: Sequence[Path]) -> Files:
    """What the parts of a take are called: the first of each kind among these files."""
    kinds = ((take.path,), take.sounds, take.transcripts)
    return Files(
        *(str(next((path for path in kind if path in among), take.path)) for kind in kinds)
    )


def _missing(take: Take) -> Iterator[Finding]:
    if take.motion is None and take.audio is not None:
        yield Finding(
            Check.MISSING,
            Severity.WARNING,
            str(take.audio),
            take.problem or f"no motion for {take.audio.name}",
            "add the BVH file under the same name, or take the audio away; as it is, the"
            " recording is left out",
        )
    if take.audio is None and take.motion is not None:
        yield Finding(
            Check.MISSING,
            Severity.WARNING,
            str(take.motion),
            take.no_audio or f"no audio for {take.motion.name}",
            "add the audio under the same name; as it is, the recording is left out, or read"
            " with data.missing_audio=silence",
        )


def _lengths(take: Take, settings: ReadingSettings) -> tuple[Path, Lengths] | None:
    """The sound file, and lengths from where the take starts in each; None where unknown.

    A take that ends before its files is cut on purpose.
    """
    if take.motion is None or take.audio is None or take.excerpt.duration is not None:
        return None
    try:
        frames, fps = read_bvh_timing(take.motion, settings.frame_rate)
    except CospeechError:
        return None  # the reader says what is wrong
    measured = first_usable(take.sounds, "sound", audio_seconds, [])
    if measured is None:
        return None  # likewise
    sound, audio_s = measured
    audio_s -= take.excerpt.audio_start
    motion_s = frames / fps - take.excerpt.motion_start
    return (sound, Lengths(motion_s, audio_s, fps)) if min(motion_s, audio_s) > 0 else None


def _words_of_file(take: Take, audio_s: float, files: Files) -> list[Finding]:
    start = take.excerpt.audio_start
    is_excerpt = take.excerpt.duration is not None
    try:
        transcript = read_transcript_with_timing(files.words, start + audio_s, goes_on=is_excerpt)
    except CospeechError:
        return []  # taken by a hair with the length of the recording
    if not transcript.words:
        return []  # looked at with the recording
    noted = [_note(files, note) for note in transcript.notes]
    if transcript.timing == SPREAD_TIMING:
        return noted
    words = [Word(word.text, word.start - start, word.end - start) for word in transcript.words]
    if start > 0:
        words = [word for word in words if word.end > 0]
        words = [Word(word.text, max(0.0, word.start), word.end) for word in words]
    return [*noted, *check_words_end(words, audio_s, files)]


def _note(files: Files, note: str) -> Finding:
    """What the reader of transcripts left out, moved or converted."""
    return Finding(
        Check.WORD_TIMES,
        Severity.WARNING,
        files.words,
        note,
        "correct the transcript, or go on with the words as they are read",
    )


def _dropped(dropped: Dropped, name: str) -> Finding:
    time = _TIME.search(dropped.reason)
    return Finding(
        Check.UNREADABLE,
        Severity.ERROR,
        name,
        dropped.reason,
        "copy or download it again; as it is, it is left out",
        time_s=float(time[1]) if time else None,
    )


def _about_file(remark: Remark, path: Path) -> Finding:
    """A side file that the recording does without, or one that is odd and is used."""
    return Finding(
        Check.ODD if remark.kind.startswith("odd ") else Check.UNREADABLE,
        Severity.WARNING,
        str(path),
        remark.text,
        remark.advice or "mend it or take it away; as it is, the recording does without",
    )


def _unreadable(name: str, whatever: Exception, fps: float | None = None) -> Finding:
    """An error as a finding, with the file and the time that it tells.

    Where an unexpected one came from is logged.
    """
    error = explained(whatever)
    if error is not whatever:
        _log.error("reading %s", name, exc_info=whatever)
    place = (error.place or "") if isinstance(error, InputFileError) else ""
    time, frame = _TIME.search(place), _FRAME.search(place)
    time_s = float(time[1]) if time else int(frame[1]) / fps if frame and fps else None
    number = "NaN" in str(error) or "not a finite number" in str(error)
    return Finding(
        Check.NOT_A_NUMBER if number else Check.UNREADABLE,
        Severity.ERROR,
        str(error.path) if isinstance(error, InputFileError) else name,
        error.problem,
        error.hint or "copy or download it again; as it is, it is left out",
        time_s=time_s,
    )
