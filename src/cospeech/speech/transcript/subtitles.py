"""Subtitles, SRT and WebVTT: phrases with times, or words where the cues time them inside."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from cospeech.errors import ContentError
from cospeech.speech.transcript.clocks import CLOCK, seconds_of
from cospeech.speech.transcript.entries import Entries, Entry, counted, require_few
from cospeech.speech.transcript.highlights import Cue, with_highlights
from cospeech.speech.transcript.labels import without_markup
from cospeech.speech.transcript.lines import numbered_lines

# A fraction is what tells cue times from a range of clock times in prose.
_CUE_CLOCK = CLOCK.removesuffix("?")
_CUE_TIMES = re.compile(rf"\s{{0,9}}\[?{_CUE_CLOCK}\s{{0,9}}-->\s{{0,9}}{_CUE_CLOCK}(.*)")
_SBV_TIMES = re.compile(rf"(?m)^({_CUE_CLOCK}),({_CUE_CLOCK})[ \t]{{0,9}}$")  # YouTube's own form
_INLINE_TIME = re.compile(rf"<{CLOCK}>")

_SHORTEST_CUE_S = 0.1
_LONGEST_PAUSE_S = 2.0
_ROLLING_SHARE = 0.5
_FEWEST_OVERLAPS = 2
_FEWEST_TOKENS = 3
_MOST_LINES = 20
_MOST_DIGITS = 9


def is_cue_times(line: str) -> bool:
    """Whether a line says when a cue is shown: ``00:00:01,000 --> 00:00:02,500``."""
    return _CUE_TIMES.match(line) is not None or _SBV_TIMES.match(line) is not None


def parse_subtitles(text: str) -> Entries:
    """Cues as phrases, or the words of cues that hold ``<00:00:01.000>`` between them.

    Cues that repeat a line for each of its words, marking that, give those words their times.
    Lines that captions carry over from the cue before (they roll) are left out. So are the cues'
    numbers, notes and styles.

    Raises:
        ContentError: A line with ``-->`` holds no two times.
    """
    text = _SBV_TIMES.sub(r"\1 --> \6", text)
    cues, repeated = _new_lines(with_highlights(_cues(text)))
    cut = _cut_where_they_stay(cues)
    entries: list[Entry] = []
    for cue in cues:
        require_few(len(entries))
        entries += _cue_entries(cue)
    notes = []
    if repeated:
        notes.append(f"{counted(repeated, 'line')} left out that captions carried over")
    if cut:
        notes.append(f"{counted(cut, 'caption')} cut where the next begins, above which they stay")
    return Entries(tuple(entries), tuple(notes), are_seconds=True)


def _cues(text: str) -> list[Cue]:
    cues: list[Cue] = []
    is_vtt = text.lstrip().startswith("WEBVTT")
    is_text = False
    aside: list[str] = []  # lines after a blank one, which belong to nothing yet
    before, is_next = "", False  # the last line with something, and whether it was the last one
    count = 0  # the number of the cue
    for place, line in numbered_lines(text, blank=True):
        if "-->" in line:
            times = _CUE_TIMES.match(line)
            if times is None:
                raise ContentError(
                    f"expected times, found {line.strip()[:60]!r}",
                    place,
                    "a cue starts with 00:00:01,000 --> 00:00:02,500",
                )
            number = int(before) if before.isdecimal() and len(before) < _MOST_DIGITS else None
            # Without a blank line before and none after it, only counting on tells a number from
            # one that is said.
            counts_on = number == count + 1 and (count > 0 or not cues)
            lines = cues[-1].lines if is_text else aside
            if number is not None and lines and (counts_on or (is_next and not is_text)):
                lines.pop()
                count = number
            _close(cues, aside, is_vtt)
            groups = times.groups()
            require_few(len(cues))
            cues.append(Cue(seconds_of(groups[:4]), seconds_of(groups[4:8]), place))
            rest = groups[8].lstrip()
            if rest.startswith("]"):  # Whisper prints [00:00.000 --> 00:02.000]  text
                cues[-1].lines.append(rest[1:])
            is_text, aside = True, []
        elif not line:
            is_text = False
        elif is_text:
            cues[-1].lines.append(line)
        else:
            aside.append(line)
        before, is_next = line.strip() or before, bool(line.strip())
    _close(cues, aside, is_vtt)
    return cues


def _close(cues: list[Cue], aside: list[str], is_vtt: bool) -> None:
    """Give the last cue what stands after a blank line in it; in VTT those are names and notes."""
    if cues and not is_vtt:
        cues[-1].lines += aside


def _new_lines(cues: Sequence[Cue]) -> tuple[list[Cue], int]:
    """Cues without the lines that they repeat of the one before, and the number of those lines."""
    before: list[list[str]] = [[]]
    for cue in cues:
        before.append([plain for line in cue.lines if (plain := _plain(line))])
    overlaps = [_overlap(one, two) for one, two in pairwise(before)]
    for index, (cue, after) in enumerate(pairwise(cues), start=1):
        if after.words or not _follows(
            cue, after, _grows(overlaps[index], *before[index : index + 2])
        ):
            overlaps[index] = 0
    count = sum(
        overlaps[index] > 0 and not _may_be_said_again(cue, after, *before[index : index + 2])
        for index, (cue, after) in enumerate(pairwise(cues), start=1)
    )
    is_rolling = count >= _FEWEST_OVERLAPS and count > _ROLLING_SHARE * (len(cues) - 1)
    new: list[Cue] = []
    repeated = 0
    for index, (cue, overlap) in enumerate(zip(cues, overlaps, strict=True)):
        lines = [line for line in cue.lines if _plain(line)]
        carried = _tokens(before[index][len(before[index]) - overlap :])
        if overlap and (
            is_rolling or _holds_on(cues[index - 1], cue, carried, _tokens(before[index + 1]))
        ):
            repeated += overlap
            lines = _without_tokens(lines, carried)
        if lines:
            new.append(replace(cue, lines=lines))
    return new, repeated


def _cut_where_they_stay(cues: Sequence[Cue]) -> int:
    """Cut cues of a file in which most stay while the next is spoken; how many were cut."""
    staying = [
        (cue, after.start) for cue, after in pairwise(cues) if cue.start < after.start < cue.end
    ]
    if len(staying) < _FEWEST_OVERLAPS or len(staying) <= _ROLLING_SHARE * (len(cues) - 1):
        return 0
    for cue, end in staying:
        cue.end = end
    return len(staying)


def _tokens(lines: Sequence[str]) -> int:
    return sum(len(line.split()) for line in lines)


def _plain(line: str) -> str:
    """A line without tags and blanks around it, to compare."""
    return " ".join(without_markup(line)[0].split())


def _overlap(before: Sequence[str], lines: Sequence[str]) -> int:
    """How many last lines of a cue the next one begins with, be it on one line or on several."""
    tokens = " ".join(lines).split()
    for count in range(min(len(before), _MOST_LINES), 0, -1):
        carried = " ".join(before[len(before) - count :]).split()
        if tokens[: len(carried)] == carried:
            return count
    return 0


def _follows(before: Cue, cue: Cue, grows: bool) -> bool:
    """Whether there is no pause between two cues, or a short one after which the text grew."""
    return cue.start - before.end < (_LONGEST_PAUSE_S if grows else _SHORTEST_CUE_S)


def _grows(overlap: int, lines: Sequence[str], new_lines: Sequence[str]) -> bool:
    """Whether a cue begins with lines of the one before and goes on: that is rarely speech."""
    return overlap > 0 and _tokens(new_lines) > _tokens(lines[len(lines) - overlap :])


def _may_be_said_again(
    before: Cue, cue: Cue, lines: Sequence[str], new_lines: Sequence[str]
) -> bool:
    """Whether a cue repeats the one before with a time of its own, so that it may be speech."""
    is_same_time = (cue.start, cue.end) == (before.start, before.end)
    is_short = min(cue.end - cue.start, before.end - before.start) < _SHORTEST_CUE_S
    return lines == new_lines and not is_same_time and not is_short


def _holds_on(before: Cue, cue: Cue, carried: int, tokens: int) -> bool:
    """Whether a cue goes on from the one before, in a file whose others mostly don't."""
    follows = abs(cue.start - before.end) < _SHORTEST_CUE_S
    is_short = cue.end - cue.start < _SHORTEST_CUE_S
    is_same = (cue.start, cue.end) == (before.start, before.end)
    return is_same or (follows and (is_short or _FEWEST_TOKENS <= carried < tokens))


def _without_tokens(lines: Sequence[str], carried: int) -> list[str]:
    """The lines without their first words."""
    rest = []
    for line in lines:
        tokens = _plain(line).split()
        if carried >= len(tokens):
            carried -= len(tokens)
        elif carried:
            # A line that grows: what is new has no tag before it in any captions that do so.
            rest.append(" ".join(tokens[carried:]))
            carried = 0
        else:
            rest.append(line)
    return rest


def _cue_entries(cue: Cue) -> list[Entry]:
    if cue.words:
        return list(cue.words)
    text = "\n".join(cue.lines)
    times = list(_INLINE_TIME.finditer(text))
    if not times:
        return [Entry(text, cue.start, cue.end, cue.place, is_phrase=True)]
    starts = [cue.start, *(seconds_of(time.groups()) for time in times)]
    bounds = [0, *(time.start() for time in times), len(text)]
    entries = []
    for index, start in enumerate(starts):
        part = text[bounds[index] : bounds[index + 1]]
        end = starts[index + 1] if index + 1 < len(starts) else cue.end
        words = without_markup(part)[0].split()
        start, end = (min(max(time, cue.start), cue.end) for time in (start, end))
        if words and start <= end:
            is_phrase = len(words) > 1
            entries.append(Entry(" ".join(words), start, end, cue.place, is_phrase))
    return entries
