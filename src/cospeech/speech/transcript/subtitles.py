"""Subtitles, SRT and WebVTT: phrases with times."""

from __future__ import annotations

import html
import re
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.speech.transcript.entries import Entries, Entry
from cospeech.speech.transcript.lines import numbered_lines

_CLOCK = r"(?:(\d{1,3}):)?(\d{1,2}):(\d{1,2})[.,](\d{1,3})"
CUE_TIMES = re.compile(rf"^\s*{_CLOCK}\s*-->\s*{_CLOCK}(?:\s.*)?$")
"""The line of a cue that says when it is shown."""

_MARKUP = re.compile(r"<[^<>]*>|\{[^{}]*\}|\[[^][]*\]")  # <i>, {\an8}, [applause]


def parse_subtitles(path: Path, text: str) -> Entries:
    """Cues as phrases; markup, sound descriptions in [brackets], notes and numbers are dropped.

    Raises:
        InputFileError: A line with ``-->`` holds no two times.
    """
    cues: list[tuple[float, float, str, list[str]]] = []
    is_text = False
    previous_line = -1
    for place, line in numbered_lines(path, text):
        line_number = int(place.removeprefix("line "))
        if line_number != previous_line + 1:
            is_text = False  # a blank line ends a cue
        previous_line = line_number
        if "-->" in line:
            times = CUE_TIMES.match(line)
            if times is None:
                raise InputFileError(
                    path,
                    f"expected times, found {line.strip()[:60]!r}",
                    place,
                    "a cue starts with 00:00:01,000 --> 00:00:02,500",
                )
            start, end = _seconds(times.groups()[:4]), _seconds(times.groups()[4:])
            cues.append((start, end, place, []))
            is_text = True
        elif is_text:
            cues[-1][3].append(html.unescape(_MARKUP.sub(" ", line)))
    entries = (Entry(" ".join(lines), start, end, place) for start, end, place, lines in cues)
    return Entries(tuple(entries), are_phrases=True)


def _seconds(clock: tuple[str | None, ...]) -> float:
    hours, minutes, seconds, fraction = clock
    whole = int(hours or 0) * 3600 + int(minutes or 0) * 60 + int(seconds or 0)
    return whole + int((fraction or "0").ljust(3, "0")) / 1000
