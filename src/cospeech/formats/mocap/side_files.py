"""What lies beside a take's motion and sound, of which each costs itself alone."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from cospeech.corpus.recording import Remark
from cospeech.errors import CospeechError
from cospeech.foreign import read_bytes, understood
from cospeech.formats.mocap.takes import Take
from cospeech.speech.speech import Word
from cospeech.speech.transcript import Transcript, read_transcript_with_timing

LOOK_CLOSER = "python -m cospeech.corpus doctor FOLDER looks closer"

T = TypeVar("T")


def first_usable(
    paths: Iterable[Path],
    what: str,
    read: Callable[[Path], T],
    remarks: list[Remark],
    is_needed: bool = False,
) -> tuple[Path, T] | None:
    """The first of several files that can be used, and what it holds; the others are remarked on.

    Raises:
        CospeechError: It is needed, and none can be used; about the preferred one.
    """
    refused: list[tuple[Path, CospeechError]] = []
    found: tuple[Path, T] | None = None
    for path in paths:
        try:
            with understood(path, what):
                found = path, read(path)
                break
        except CospeechError as error:
            refused.append((path, error))
    if found is None and is_needed:
        raise refused[0][1]
    if found is None:
        kind, so = f"without {what}", f"not used as {what}:"
    else:
        kind = f"{what} that can't be used; another is"
        so = f"{found[0].name} is used as {what}, since"
    remarks += [
        Remark(kind, f"{so} {error.problem}", error.hint or "", path) for path, error in refused
    ]
    return found


def spoken(
    take: Take, paths: Iterable[Path], what: str, audio_s: float, remarks: list[Remark]
) -> tuple[Path, Transcript] | None:
    """The first usable transcript on the excerpt's clock; where all are empty, nobody speaks."""
    blank = [path for path in paths if _is_blank(path)]
    written = [path for path in paths if path not in blank]
    if blank and not written:
        text = f"{blank[0].name} is empty: nobody speaks in this take"
        remarks.append(Remark("empty transcript", text, "take the file away if it is not so"))
        return blank[0], Transcript((), "words")
    remarks += [
        Remark("empty transcript beside another", f"{path}: is empty", "take it away", path)
        for path in blank
    ]
    read_words = functools.partial(_words, take, audio_s=audio_s, remarks=remarks)
    return first_usable(written, what, read_words, remarks)


def _is_blank(path: Path) -> bool:
    try:
        return not read_bytes(path, "a transcript", 1024).strip(b" \t\r\n\xef\xbb\xbf")
    except CospeechError:
        return False  # it is longer, or its reader says why it can't be read


def _words(take: Take, path: Path, *, audio_s: float, remarks: list[Remark]) -> Transcript:
    start = take.excerpt.audio_start
    is_excerpt = take.excerpt.duration is not None
    transcript = read_transcript_with_timing(path, start + audio_s, goes_on=is_excerpt)
    remarks += [
        Remark("words moved or dropped", f"{path.name}: {note}", LOOK_CLOSER)
        for note in transcript.notes
    ]
    words = transcript.words
    if start > 0:
        words = tuple(
            Word(word.text, max(0.0, word.start - start), word.end - start)
            for word in words
            if word.end > start
        )
    return replace(transcript, words=words)


def words_until(words: Iterable[Word] | None, end_s: float) -> tuple[Word, ...] | None:
    """Words of which the last ones end where the sound does; None of none."""
    if words is None:
        return None
    return tuple(replace(word, end=min(word.end, end_s)) for word in words if word.start < end_s)
