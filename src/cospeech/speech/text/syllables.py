"""Syllables of English words by their spelling, as Gesticulator counts them.

See docs/facts/trinity_and_gesticulator.md, section 3.
"""

from __future__ import annotations

import re

_VOWELS = "aeiou"
_NO_LOST_ENDING = ("ted", "tes", "ses", "ied", "ies")
_SPOKEN_E = frozenset(
    (
        *("whole", "mobile", "pole", "male", "female", "hale", "pale"),
        *("tale", "sale", "aisle", "whale", "while"),
    )
)
_ONE_SYLLABLE_CO = frozenset(
    (
        *("cool", "coach", "coat", "coal", "count", "coin", "coarse"),
        *("coup", "coif", "cook", "coign", "coiffe", "coof", "court"),
    )
)
_TWO_SYLLABLE_CO = ("coapt", "coed", "coinci")
_LESS = frozenset(("fortunately", "unfortunately"))
_MORE = frozenset(("doesn't", "isn't", "shouldn't", "couldn't", "wouldn't", "serious", "crucial"))


def count_syllables(word: str) -> int:
    """How many syllables a word has by Gesticulator's rule; some ordinary ones have none.

    ``three``, ``free`` and ``knee`` give 0, as do numbers in digits of four and more.

    Args:
        word: As it is written, punctuation included.
    """
    word = word.lower()
    if len(word) <= 3:
        return 1
    vowels = sum(letter in _VOWELS for letter in word)
    return vowels - _silent(word) + _more(word)


def _silent(word: str) -> int:
    pairs = len(re.findall(r"[aeiou]{2}", word))
    silent = pairs + len(re.findall(r"[aeiou]{3}", word)) + (word in _LESS)
    if word.endswith(("es", "ed")) and not word.endswith(_NO_LOST_ENDING):
        silent += pairs > 1 or len(re.findall(r"[aeiou][^aeiou]", word)) > 1
    if word.endswith("e"):
        silent += not word.endswith("le") or word in _SPOKEN_E
    return silent


def _more(word: str) -> int:
    more = word.startswith("mc") + (word in _MORE)
    more += bool(re.search(r"[^aeiou]y$", word))
    more += len(re.findall(r"[^aeiou](?=y[^aeiou])", word))
    more += bool(re.match(r"(tri|bi)[aeiou]", word))
    more += word.endswith("ian") and not word.endswith(("cian", "tian"))
    if re.match(r"co[aeiou]", word):
        known = any(word[:length] in _ONE_SYLLABLE_CO for length in (4, 5, 6))
        more += word.startswith(_TWO_SYLLABLE_CO) or not known
    more += bool(re.match(r"pre[aeiou]", word)) and not word.startswith("preach")
    return more
