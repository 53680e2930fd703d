"""What a label is: a word, a silence, a sound, a clock time, markup, a phone."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable

SILENCE_LABELS = frozenset(
    {"", "sil", "sp", "spn", "pau", "<eps>", "<sil>", "<p>", "<p:>", "{sl}", "{sp}", "#"}
)
"""Labels (lower case) by which aligners mark an interval without a word."""

_SPOKEN_SYMBOLS = frozenset("&%@$€£+")

# Every pattern here either has no repeat that can give back what it took, or is bounded.
_CLOCK = re.compile(
    r"[\[(]?\d{1,3}:[0-5]?\d(?::[0-5]?\d(?:[.,]\d{1,6})?|[.,]\d{1,6})[\])]?[:,;]?"
    r"|[\[(]\d{1,3}:[0-5]\d[\])][:,;]?"
)
_TIME = re.compile(
    r"(?m)^\W{0,3}\d{1,3}:[0-5]\d(?!\d)"  # 00:12 at the start of a line
    r"|(?<![\d.:])(?:\d{1,3}:[0-5]\d[.,:]|\d{1,5}\.)\d{1,6}(?:[.,]\d{1,6})?(?![\d:])"
)
_UNMISTAKABLE = re.compile(
    r"(?m)(?<![\d:.])\d{1,2}:[0-5]\d:[0-5]\d[:;]\d{2}(?![\d:])"  # 00:00:01:12, with a frame
    r"|^\s{0,9}[\[(<]\d{1,3}:[0-5]\d[.,:]\d{1,6}[\])>]"  # [00:01.20] at the start of a line
    r"|(?:^|\s)\d{1,5}\.\d{1,6}\s{1,9}\d{1,5}\.\d{1,6}\s"  # 0.40 2.60 next to each other
    r"|^[^\W_a-z][^\s:.]{0,40}(?: [^\W_a-z][^\s:.]{0,40}){0,2}"  # Ann Berg 0:05
    r"[ \t]{1,9}[\[(]?0{1,2}:[0-5]\d[\])]?\s*$"
)
_SPEAKER = re.compile(
    r"(?m)^[-\u2013\u2014 \t]{0,3}([^\s:]{1,30}(?: [^\s:]{1,30}){0,3}):[ \t]{1,9}(?=\S)"
)
_SPEAKERS_SHARE = 0.2  # of the lines say who speaks
_AT_AN_END = re.compile(
    r"(?m)^\W{0,3}((?:\d{1,2}:)?\d{1,3}:[0-5]\d)\b"
    r"|\s\W{0,2}((?:\d{1,2}:)?\d{1,3}:[0-5]\d)\W{0,3}$"
)
_ARROW = re.compile(r"-{1,2}>")
_TAG = re.compile(r"</?[a-zA-Z0-9:][^<>]{0,200}+>")
_FEWEST_CLOCKS, _MOST_CLOCKS = 3, 0.2  # at ends of lines, and their share of the lines
_UNKNOWN = frozenset({"<unk>", "<UNK>"})
_IN_BRACKETS = re.compile(r"\[[^\[\]]*+\]|\{[^{}]*+\}")

_ARPABET_NAMES = """
    AA AE AH AO AW AX AXR AY B CH D DH DX EH EL EM EN ER EY F G HH IH IX
    IY JH K L M N NG OW OY P R S SH T TH UH UW UX V W Y Z ZH
"""
_ARPABET = frozenset(_ARPABET_NAMES.split())
_FEWEST_ARPABET = 4
_FEWEST_SHORT = 10
_PHONETIC = frozenset("æçðøħŋœβθχ")
_VOWELS = frozenset("aeiouyAEIOUY")
_PLACE = re.compile(r"^[^\W_]{1,4}_[BIES]$")
_DIACRITIC = re.compile(r"_.|(?<=.)[:`=~\"%]|[\u02b0-\u02ff\u0300-\u036f]")  # X-SAMPA's, IPA's

_ANNOTATION_LABELS = """
    stroke hold preparation prep retraction retract recoil rest
    happy happiness sad sadness angry anger neutral fear fearful disgust disgusted surprise
    surprised calm excited excitement frustrated frustration contempt
"""
_ANNOTATIONS = frozenset(_ANNOTATION_LABELS.split())


def is_spoken(label: str) -> bool:
    """Whether a label stands for a word, not for a silence, a dash or a note."""
    label = label.strip()
    return label.lower() not in SILENCE_LABELS and any(
        character.isalnum() or character in _SPOKEN_SYMBOLS for character in label
    )


def without_clocks(text: str) -> tuple[str, int]:
    """A text without the clock times among its tokens, and how many those were.

    Clock times are ``00:00:01,000``, ``1:02.5`` and ``-->``; ``10:30`` is something one says.
    """
    if ":" not in text and "->" not in text:
        return text, 0
    tokens = text.split()
    kept = [t for t in tokens if not (_CLOCK.fullmatch(t) or _ARROW.fullmatch(t))]
    if len(kept) == len(tokens):
        return text, 0
    return " ".join(kept), sum(_CLOCK.fullmatch(token) is not None for token in tokens)


def times_within(text: str) -> list[str]:
    """Clock times and decimal fractions anywhere in a text."""
    return [found.group().strip("[(\n \t") for found in _TIME.finditer(text)]


def times_of_a_list(text: str) -> list[str]:
    """Times that no prose has: with frames, in brackets before lines, two next to each other.

    So have clock times at an end of most lines that never go back.
    """
    found = [time.group().strip("[](<>)\n \t") for time in _UNMISTAKABLE.finditer(text)]
    if found:
        return found
    clocks = [one or other for one, other in _AT_AN_END.findall(text)]
    lines = sum(bool(line.strip()) for line in text.splitlines())
    seconds = [_seconds(clock) for clock in clocks]
    is_list = len(clocks) >= _FEWEST_CLOCKS and len(clocks) > _MOST_CLOCKS * lines
    return clocks if is_list and seconds == sorted(seconds) else []


def _seconds(clock: str) -> int:
    total = 0
    for part in clock.split(":"):
        total = 60 * total + int(part)
    return total


def without_markup(text: str) -> tuple[str, int]:
    """A text without tags, entities and sounds in brackets, and how many those were.

    ``<i>Say</i>`` is Say, ``AT&amp;T`` is AT&T, ``&nbsp;`` and ``[applause]`` are nothing.
    """
    count = 0
    if "&" in text and ";" in text:
        plain = html.unescape(text)
        count += plain != text
        text = plain.replace("\ufeff", "").replace("\u200b", "")
    if "<" in text and text not in _UNKNOWN:
        text, tags = _TAG.subn("", text)
        count += tags
    if "[" in text or "{" in text:
        text, brackets = _IN_BRACKETS.subn(" ", text)
        count += brackets
    return text.strip(), count


def speakers_of(texts: Iterable[str]) -> frozenset[str]:
    """Names of speakers before what they say: ``Anna Berg: ...``, several times.

    A name said once counts only where most lines have one.
    """
    counts: Counter[str] = Counter()
    lines = 0
    for text in texts:
        counts.update(filter(_is_name, _SPEAKER.findall(text)))
        lines += text.count("\n") + 1
    fewest = 1 if 2 * counts.total() > lines else 2
    if not counts or max(counts.values()) < 2 or counts.total() <= _SPEAKERS_SHARE * lines:
        return frozenset()
    return frozenset(name for name, count in counts.items() if count >= fewest)


def without_speakers(text: str, names: frozenset[str]) -> str:
    """A text without those names, and their colons, at the starts of its lines."""
    return _SPEAKER.sub(lambda found: "" if found[1] in names else found[0], text)


def _is_name(text: str) -> bool:
    return text[0].isupper() and all(part[0].isupper() or part.isdigit() for part in text.split())


def are_phones(labels: Iterable[str]) -> bool:
    """Whether labels are ARPABET, or so short throughout that they are IPA or SAMPA.

    Kaldi's places in the word (``AH0_B``), marks of length and other diacritics don't count.
    Languages written in syllables or ideographs have words of one character, so only Latin and
    phonetic letters count.
    """
    spoken = [label.strip() for label in labels if is_spoken(label)]
    spoken = [label for label in spoken if not label.isdigit() and label.lower() != "<unk>"]
    if len(spoken) < _FEWEST_ARPABET:
        return False
    most = 0.8 * len(spoken)
    if sum(_PLACE.search(label) is not None for label in spoken) >= most:
        return True
    spoken = [_DIACRITIC.sub("", label) or label for label in spoken]
    stressed = sum(label[-1] in "012" and label[:-1] in _ARPABET for label in spoken)
    if stressed and sum(label.rstrip("012") in _ARPABET for label in spoken) >= most:
        return True
    # "oh", "mm" and "I" are words; consonants alone are none.
    short = [label for label in spoken if len(label) <= 2 and all(map(_is_phonetic, label))]
    consonants = sum(len(label) == 1 and label not in _VOWELS for label in short)
    return len(short) >= max(most, _FEWEST_SHORT) and consonants >= 0.2 * len(short)


def are_annotations(labels: Iterable[str]) -> bool:
    """Whether labels are phases of gestures or emotions throughout, and several."""
    spoken = [label.strip().lower() for label in labels if is_spoken(label)]
    return len(spoken) > 1 and _ANNOTATIONS.issuperset(spoken)


def _is_phonetic(letter: str) -> bool:
    return letter.isascii() or letter in _PHONETIC or "\u0250" <= letter <= "\u036f"
