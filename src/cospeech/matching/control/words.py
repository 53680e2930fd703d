"""Patterns of words: which words of a transcript are meant."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field

from cospeech.errors import ConfigError, CospeechError
from cospeech.foreign import LinearPattern, linear_pattern

MOST_PATTERN_CHARACTERS = 200
LONGEST_WORD = 40
"""Characters; nothing longer is a word."""

_EDGES = re.compile(r"^[\W_]+|[\W_]+\Z")


@dataclass(frozen=True)
class WordPattern:
    """A regular expression that the whole word has to match, upper or lower case.

    A search takes time in proportion to the word, whatever the expression says; look-around and
    references back to a group aren't known.

    Attributes:
        text: The expression, e.g. ``"big|huge|enormous"``.

    Raises:
        ConfigError: It is no such expression, or too long.
    """

    text: str
    _regex: LinearPattern = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.text.strip():
            raise ConfigError("the pattern of words is empty", 'give words, e.g. "big|huge"')
        if len(self.text) > MOST_PATTERN_CHARACTERS:
            raise ConfigError(
                f"the pattern of words {self.text[:40]!r}... has {len(self.text)} characters, more"
                f" than {MOST_PATTERN_CHARACTERS}",
                "join several shorter ones: word(...) or word(...)",
            )
        try:
            regex = linear_pattern(unicodedata.normalize("NFC", self.text), ignore_case=True)
        except CospeechError as error:
            raise ConfigError(
                f"the pattern of words {self.text!r} can't be taken: {error.problem}",
                f"give words, e.g. big|huge|enormous; {error.hint}",
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
