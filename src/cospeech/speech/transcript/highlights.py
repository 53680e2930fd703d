"""Captions that show a line once per word, the current word marked (Whisper's highlighting)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

from cospeech.speech.transcript.entries import Entry

_MARKED = re.compile(r"<([a-zA-Z]{1,9})(?:[ .][^<>]{0,200})?>([^<>]{1,1000})</\1>")


@dataclass
class Cue:
    """A caption.

    Attributes:
        start: When it appears, s.
        end: When it goes, s.
        place: Where it stands in the file, for messages.
        lines: What it shows.
        words: What it shows word by word, where that is known.
    """

    start: float
    end: float
    place: str
    lines: list[str] = field(default_factory=list)
    words: tuple[Entry, ...] = ()


@dataclass(frozen=True)
class _Shown:
    cue: Cue
    plain: str
    marked: tuple[int, int] | None  # from which character of the plain text to which


def with_highlights(cues: Sequence[Cue]) -> list[Cue]:
    """Cues of which those that differ only in the part that is marked are one, with its words.

    A marked part is said while it is marked; the rest of the text has no times.
    """
    shown = [_shown(cue) for cue in cues]
    result: list[Cue] = []
    for _, group in groupby(shown, key=lambda one: one.plain):
        for run in _runs(list(group)):
            if len({one.marked for one in run} - {None}) > 1:
                result.append(_joined(run))
            else:
                result += [one.cue for one in run]
    return result


def _shown(cue: Cue) -> _Shown:
    text = " ".join(cue.lines)
    found = list(_MARKED.finditer(text))
    if len(found) != 1:
        return _Shown(cue, text, None)
    (mark,) = found
    plain = text[: mark.start()] + mark[2] + text[mark.end() :]
    return _Shown(cue, plain, (mark.start(), mark.start() + len(mark[2])))


def _runs(shown: Sequence[_Shown]) -> list[list[_Shown]]:
    """The cues of one text, parted where the mark goes back: there the text is said again."""
    runs: list[list[_Shown]] = []
    last = (0, 0)
    for one in shown:
        if not runs or (one.marked is not None and one.marked < last):
            runs.append([])
        last = one.marked or last
        runs[-1].append(one)
    return runs


def _joined(run: Sequence[_Shown]) -> Cue:
    first, plain = run[0].cue, run[0].plain
    words: list[Entry] = []
    done = 0
    for one in run:
        if one.marked is None:
            continue
        start, end = max(one.marked[0], done), one.marked[1]
        if end <= done:  # the same word goes on
            words[-1] = replace(words[-1], end=one.cue.end)
            continue
        if plain[done:start].strip():
            words.append(Entry(plain[done:start], None, None, one.cue.place, is_phrase=True))
        words.append(Entry(plain[start:end], one.cue.start, one.cue.end, one.cue.place))
        done = end
    if plain[done:].strip():
        words.append(Entry(plain[done:], None, None, run[-1].cue.place, is_phrase=True))
    end_s = max(one.cue.end for one in run)
    return Cue(first.start, end_s, first.place, [plain], tuple(words))
