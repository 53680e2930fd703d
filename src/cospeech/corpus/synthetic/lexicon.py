"""Which words evoke a gesture of their own."""

from __future__ import annotations

BEAT = "beat"
"""Gesture without lexical meaning, on a stressed syllable."""

LISTING = "listing"
"""One of several beats that place the items of a list side by side."""

INDEPENDENT_HOLD = "independent_hold"
"""A pose that is struck and held without a stroke."""

_WORDS_OF_CONCEPT = {
    "size_large": "huge enormous giant massive big large wide gigantic vast broad",
    "size_small": "tiny small little narrow thin miniature",
    "left": "left",
    "right": "right",
    "up": "up upstairs above high higher top",
    "down": "down downstairs below low lower bottom",
    "forward": "forward ahead straight",
    "back": "back behind backwards",
    "there": "there here",
    "number": "one two three four five six seven eight nine ten twelve twenty hundred dozen first"
    " second third",
    "self": "i me my we us our myself",
    "other": "you your they them their everyone everybody she he",
    "negation": "no not never nothing none nobody nowhere don't didn't can't won't couldn't wasn't",
    "cycle": "around again round circle cycle wheel turning",
    "uncertain": "maybe perhaps somehow probably wonder",
}

CONCEPT_OF_WORD: dict[str, str] = {
    word: concept for concept, words in _WORDS_OF_CONCEPT.items() for word in words.split()
}
"""Lower-case word -> concept."""

CONCEPTS: tuple[str, ...] = (*_WORDS_OF_CONCEPT, BEAT, LISTING, INDEPENDENT_HOLD)
"""Every kind of gesture in the corpus."""

FINGERS_FOR_NUMBER: dict[str, int] = {
    "one": 1,
    "first": 1,
    "two": 2,
    "second": 2,
    "three": 3,
    "third": 3,
    "four": 4,
}
"""Fingers shown while counting; every other number shows the open hand."""


def concept_of(word: str) -> str | None:
    """The concept that a word evokes, or None.

    Args:
        word: As transcribed; case doesn't matter.
    """
    return CONCEPT_OF_WORD.get(word.lower())
