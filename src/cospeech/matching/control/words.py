"""Patterns of words: which words of a transcript are meant."""

from __future__ import annotations

import re
import unicodedata
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field

from cospeech.errors import ConfigError

MOST_PATTERN_CHARACTERS = 200
MOST_REPEATS = 6
LONGEST_WORD = 40
"""Characters; nothing longer matches, as a pattern's cost grows with the word."""

_EDGES = re.compile(r"^[\W_]+|[\W_]+$")
_ESCAPES_AND_SETS = re.compile(r"\\.|\[\^?\]?[^\]]*\]")


@dataclass(frozen=True)
class WordPattern:
    """A regular expression that the whole word has to match, upper or lower case.

    A search that goes back and forth could take years on a long word, so repeats are bounded.

    Attributes:
        text: The expression, e.g. ``"big|huge|enormous"``.

    Raises:
        ConfigError: It is no regular expression, too long, or repeats too much.
    """

    text: str
    _regex: re.Pattern[str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.text.strip():
            raise ConfigError("the pattern of words is empty", 'give words, e.g. "big|huge"')
        if len(self.text) > MOST_PATTERN_CHARACTERS:
            raise ConfigError(
                f"the pattern of words {self.text[:40]!r}... has {len(self.text)} characters, more"
                f" than {MOST_PATTERN_CHARACTERS}",
                "join several shorter ones: word(...) or word(...)",
            )
        plain = _ESCAPES_AND_SETS.sub("x", self.text).replace("(?", "(")
        repeats = sum(plain.count(sign) for sign in "*+?{")
        if re.search(r"\)[*+{]", plain) or repeats > MOST_REPEATS:
            raise ConfigError(
                f"the pattern of words {self.text!r} repeats a group or more than {MOST_REPEATS}"
                " parts, which could take for ever",
                "spell the words out: one|two|three",
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that [[ may mean something else some day
                regex = re.compile(unicodedata.normalize("NFC", self.text), re.IGNORECASE)
        except (re.error, OverflowError, RecursionError) as error:
            raise ConfigError(
                f"the pattern of words {self.text!r} is no regular expression: {error}",
                "give words, e.g. big|huge|enormous",
            ) from None
        object.__setattr__(self, "_regex", regex)

    def matches(self, word: str) -> bool:
        """Whether a word is meant, as it is or without the punctuation around it."""
        if len(word) > 2 * LONGEST_WORD:
            return False
        # Transcripts of some systems spell an accented letter as two characters.
        word = unicodedata.normalize("NFC", word)
        forms = {word.strip(), _EDGES.sub("", word)}
        return any(
            0 < len(form) <= LONGEST_WORD and self._regex.fullmatch(form) is not None
            for form in forms
        )

    def among(self, vocabulary: Iterable[str]) -> list[int]:
        """Indices of the words that are meant."""
        return [i for i, word in enumerate(vocabulary) if self.matches(word)]
