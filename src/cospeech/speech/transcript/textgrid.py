"""Praat TextGrid files, long and short form."""

from __future__ import annotations

import re
from collections.abc import Iterator

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, Entry, require_few
from cospeech.speech.transcript.tiers import Tier, words_tier

# Praat reads its text files as a sequence of free-standing numbers, quoted strings and <flags>;
# everything else is decoration. So the long and the short form are one format. (praatio 6.2 was
# tried: it drops minus signs, refuses 5e-05, and stops silently at the first broken entry.)
# No repeat gives back what it took, so that a search takes time in proportion to the text.
_TOKEN = re.compile(
    r"""(?m)^[ \t]*+!.*+$                                              # comment
    | (?P<string>"[^"]*+(?:""[^"]*+)*+")
    | (?P<flag><\w++>)
    | (?<!\S)(?P<number>[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)(?:[eE][-+]?+[0-9]++)?+)(?!\S)
    | (?P<open>")""",
    re.VERBOSE,
)


_MOST_LABELS = 300_000  # of all tiers, phones too


def parse_textgrid(text: str) -> Entries:
    """Entries of the tier that holds the words.

    `words_tier` says which that is.

    Raises:
        ContentError: Broken, without words, or it's not clear which tier is meant.
    """
    tier = words_tier(_interval_tiers(text))
    return Entries(tuple(tier.entries), are_seconds=True)


class _Tokens:
    """The tokens of a text, with the line each stands on."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._matches = self._tokens()
        self._position = self._line_end = 0
        self.line = 1

    def _tokens(self) -> Iterator[re.Match[str]]:
        for match in _TOKEN.finditer(self._text):
            if match.lastgroup is not None:
                yield match

    def next(self, kind: str, what: str) -> str:
        match = next(self._matches, None)
        if match is None:
            raise ContentError(
                f"the file ends where {what} should stand",
                place=f"line {self._text.count(chr(10)) + 1}",
                hint="the file is cut off: copy or export it again",
            )
        self.line += self._text.count("\n", self._position, match.start())
        self._position = match.start()
        if match.lastgroup != kind:
            raise ContentError(
                f"expected {what}, found {match.group()[:40]!r}",
                place=f"line {self.line}",
                hint="open the file in Praat and save it again as a text file",
            )
        return match.group()

    def string(self, what: str) -> str:
        return self.next("string", what)[1:-1].replace('""', '"')

    def number(self, what: str) -> float:
        return float(self.next("number", what))

    def count(self, what: str) -> int:
        value = self.number(what)
        if not (value.is_integer() and 0 <= value <= _MOST_LABELS):
            raise ContentError(f"{what} is {value:g}", place=f"line {self.line}")
        return int(value)


def _interval_tiers(text: str) -> list[Tier]:
    tokens = _Tokens(text)
    for expected in ("ooTextFile", "TextGrid"):
        found = tokens.string(f'"{expected}"')
        if not found.startswith(expected):
            raise ContentError(
                f"is not a TextGrid in text form: it says {found[:40]!r}, not {expected!r}",
                place=f"line {tokens.line}",
                hint="in Praat: select the TextGrid, Save as text file",
            )
    tokens.number("the start time")
    tokens.number("the end time")
    if tokens.next("flag", "<exists>") != "<exists>":
        raise ContentError("has no tiers", hint="save the TextGrid with a 'words' tier")
    tiers = []
    count = 0
    for _ in range(tokens.count("the number of tiers")):
        kind = tokens.string("a tier class")
        tier = Tier(tokens.string("a tier name"))
        tokens.number("the tier's start time")
        tokens.number("the tier's end time")
        for _ in range(tokens.count("the number of intervals")):
            count += 1
            require_few(count, _MOST_LABELS)
            start = tokens.number("a start time")
            place = f"line {tokens.line}"
            end = tokens.number("an end time") if kind == "IntervalTier" else start
            tier.entries.append(Entry(tokens.string("a label"), start, end, place))
        if kind == "IntervalTier":
            tiers.append(tier)
    return tiers
