"""Lines and numbers of text formats, and transcripts of one bracketed list per line."""

from __future__ import annotations

import re
from collections.abc import Iterator

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, Entry, require_few

_MAX_LINE_CHARACTERS = 5_000
_MAX_NUMBER_CHARACTERS = 40
_MOST_LINES = 500_000

_ESCAPE = re.compile(r"\\(?:x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4})|(.))")
_CONTROL = {"n": "\n", "t": "\t", "r": "\r", "b": "", "f": ""}
_SURROGATE = re.compile("[\ud800-\udfff]")


def numbered_lines(text: str, blank: bool = False) -> Iterator[tuple[str, str]]:
    """Lines with their place, e.g. ("line 3", "0.1 0.2 word"); blank ones only where asked for.

    Raises:
        ContentError: A line is absurdly long, or there are absurdly many.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if number > _MOST_LINES:
            problem, hint = f"more than {_MOST_LINES} lines", "give the transcript of one recording"
            raise ContentError(problem, hint=hint)
        if len(line) > _MAX_LINE_CHARACTERS:
            raise ContentError(
                f"a line of {len(line)} characters",
                place=f"line {number}",
                hint="one word per line is expected",
            )
        if blank or line.strip():
            yield f"line {number}", line


def number(text: str) -> float | None:
    """The number that a text is, and None where it is none (or one of hundreds of digits).

    A comma may stand for the point.
    """
    text = text.strip()
    if not text or len(text) > _MAX_NUMBER_CHARACTERS or "_" in text or text.endswith(","):
        return None
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def is_bracketed(line: str) -> bool:
    """Whether a line looks like ``['word', 0.1, 0.2]``."""
    line = line.strip().rstrip(",")
    return (
        line.startswith(("[", "("))
        and line.endswith(("]", ")"))
        and line[1:].lstrip().startswith(("'", '"'))
        and line.count(",") >= 2
    )


def parse_bracketed(text: str) -> Entries:
    """``['word', start, end]`` in seconds, a Python or JSON list per line (TED-culture).

    Raises:
        ContentError: A line is something else.
    """
    entries: list[Entry] = []
    for place, line in numbered_lines(text):
        require_few(len(entries))
        entry = _bracketed(line.strip().rstrip(","), place)
        if entry is None:
            raise ContentError(
                f"expected ['word', start, end], found {line.strip()[:60]!r}",
                place,
                "one such list per line, times in seconds",
            )
        entries.append(entry)
    return Entries(tuple(entries))


def _bracketed(line: str, place: str) -> Entry | None:
    if not is_bracketed(line):
        return None
    quoted, first, second = line[1:-1].rsplit(",", 2)
    start, end = number(first), number(second)
    quoted = quoted.strip()
    if len(quoted) < 2 or quoted[0] != quoted[-1] or start is None or end is None:
        return None
    return Entry(_ESCAPE.sub(_unescaped, quoted[1:-1]), start, end, place)


def _unescaped(found: re.Match[str]) -> str:
    code = found[1] or found[2]
    if code:
        return _SURROGATE.sub("\ufffd", chr(int(code, 16)))
    return _CONTROL.get(found[3], found[3])
