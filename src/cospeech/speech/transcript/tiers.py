"""Which of a file's tiers holds the words, by its name or else by what is in it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entry
from cospeech.speech.transcript.labels import are_phones, is_spoken

_WORD_NAMES = """
    word words wrd ort ortho orthography token tokens tokensalign lexical wort worte wörter mot
    mots palabra palabras parola parole palavra palavras woord woorden слово слова słowo słowa
    ord sana sanat kelime kelimeler szó szavak 词 词语 单词 詞 單詞 字 汉字 単語 文節 단어 어절
"""
_PHONE_NAMES = """
    phone phones phn phon phoneme phonemes phonemic phonetic phonetics mau kan mas ipa sampa
    phonalign phntokalign segment segments syllable syllables syll syl laut laute silbe silben
    phonème phonèmes syllabe syllabes fonema fonemas fono fonos fonemi foni sílaba sílabas
    sillabe foneem fonemen fonem fonemy głoski фонема фонемы звуки 音素 音節 音节 音位 声母 韵母
    声韵母 拼音 음소 음절
"""
_OTHER_NAMES = """
    gesture gestures phase phases stroke strokes hand hands handedness gaze posture viseme visemes
    emotion emotions affect sentiment valence arousal pos upos xpos postag postags tobi tones
    break breaks geste gestes
"""
_OTHERS = frozenset(_OTHER_NAMES.split())
_WORDS, _PHONES = frozenset(_WORD_NAMES.split()), frozenset(_PHONE_NAMES.split())
_SEPARATORS = re.compile(r"[\W_\d]+")


@dataclass
class Tier:
    """A tier of labels with times."""

    name: str
    entries: list[Entry] = field(default_factory=list)


def words_tier(tiers: Sequence[Tier]) -> Tier:
    """The tier that holds the words.

    That is the one called "words" in any of a dozen languages (also "speaker - words", "ORT-MAU");
    else the only one that is neither called after phones or syllables nor full of them, nor called
    after gestures, emotions or parts of speech.

    Raises:
        ContentError: There are no words, or it's not clear which tier is meant.
    """
    names = ", ".join(repr(tier.name) for tier in tiers) or "none"
    named = [tier for tier in tiers if is_word_tier(tier.name)]
    spoken = [tier for tier in named if _has_words(tier)]
    if len(spoken) == 1 or (named and not spoken):
        return (spoken or named)[0]
    if named:
        raise ContentError(
            f"several tiers hold words (tiers: {names})",
            hint="one file per speaker is expected: remove the other speakers' tiers",
        )
    unnamed = [tier for tier in tiers if _OTHERS.isdisjoint(_parts(tier.name))]
    if tiers and not unnamed:
        raise ContentError(
            f"holds no words (tiers: {names})",
            hint="give a file with the words that are said, in a tier called 'words'",
        )
    others = [tier for tier in unnamed if not _holds_phones(tier)]
    if tiers and not others:
        raise ContentError(
            f"holds phones and no words (tiers: {names})",
            hint="give the aligner's file with the tier of the words, called 'words'",
        )
    if len(others) > 1:
        others = [tier for tier in others if _has_words(tier)]
    if len(others) == 1:
        return others[0]
    raise ContentError(
        f"no interval tier is called 'words' (tiers: {names})",
        hint="rename the tier that holds the words to 'words'",
    )


def is_word_tier(name: str) -> bool:
    """Whether a tier is called after words."""
    return not _WORDS.isdisjoint(_parts(name))


def _holds_phones(tier: Tier) -> bool:
    is_called_so = not _PHONES.isdisjoint(_parts(tier.name))
    return is_called_so or are_phones(entry.text for entry in tier.entries)


def _has_words(tier: Tier) -> bool:
    return any(is_spoken(entry.text) for entry in tier.entries)


def _parts(name: str) -> Iterable[str]:
    return (part for part in _SEPARATORS.split(name.strip().lower()) if part)
