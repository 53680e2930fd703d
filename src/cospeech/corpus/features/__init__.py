"""The catalogue of what a batch can hold: a file per field or family, and a line here.

A **field** is what a method declares by name and a batch holds: sound, words, motion, and all that
is computed of them. What is called features elsewhere (acoustic features, word vectors) are fields
of speech, `SpeechField`, computed once per corpus and kept in its store's folder ``features``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from cospeech.corpus.features.acoustics import ACOUSTICS, ENERGY, MFCC, PITCH
from cospeech.corpus.features.audio import AUDIO
from cospeech.corpus.features.cepstra import CEPSTRA, GESTICULATOR_CEPSTRA, STATIC_CEPSTRA
from cospeech.corpus.features.field import Field, FieldSource
from cospeech.corpus.features.joints import JOINTS, PHASES, POSES, WRISTS
from cospeech.corpus.features.mel import GESTICULATOR, TRIMODAL
from cospeech.corpus.features.positions import POSITIONS
from cospeech.corpus.features.prosody import GESTICULATOR_PROSODY
from cospeech.corpus.features.rotations import ROOT, ROTATIONS
from cospeech.corpus.features.speakers import SPEAKERS
from cospeech.corpus.features.spoken_words import SPOKEN_WORDS
from cospeech.corpus.features.word_vectors import WORD_VECTORS
from cospeech.corpus.features.words import WORDS
from cospeech.errors import ConfigError

MATCHED = Field(
    name="matched",
    reads="search",
    axis="method frames",
    width=None,
    unit="as poses: motion found for the same speech by a method's search",
)

FIELDS: Mapping[str, Field] = {
    field.name: field
    for field in (
        POSITIONS,
        AUDIO,
        WORDS,
        WORD_VECTORS,
        SPOKEN_WORDS,
        SPEAKERS,
        JOINTS,
        POSES,
        WRISTS,
        ROTATIONS,
        ROOT,
        PHASES,
        ACOUSTICS,
        MFCC,
        PITCH,
        ENERGY,
        CEPSTRA,
        STATIC_CEPSTRA,
        TRIMODAL,
        GESTICULATOR,
        GESTICULATOR_CEPSTRA,
        GESTICULATOR_PROSODY,
        MATCHED,
    )
}
"""Every field by its name."""

_LACKING: Mapping[FieldSource, tuple[str, str]] = {
    "upper body": (
        "3-D positions of the upper body",
        "2-D keypoints have none, nor has a skeleton without arms: choose a 3-D corpus (for"
        " Berkeley data.kind=3d), or a method that can do with what there is",
    ),
    "motion": (
        "3-D motion",
        "2-D keypoints have none: choose a 3-D corpus (for Berkeley data.kind=3d)",
    ),
    "sound": ("sound", "use a corpus with audio, or a method that reads none"),
    "words": (
        "transcripts",
        "put one beside each sound file (.TextGrid, .json, .tsv ...), or train a method on sound"
        " alone that can: model.text=none",
    ),
    "speaker": ("speakers", "use a corpus that says who speaks, or a method that doesn't ask"),
    "search": (
        "motion that a search found",
        "it comes with the windows of a method that searches (model=knn_cgan)",
    ),
    "rotations": (
        "rotations of the joints",
        "they come with motion capture as BVH and with the embedded corpus: data=mocap, trinity,"
        " genea, beat, zeggs or synthetic",
    ),
    "phases": (
        "gesture phases",
        "use a corpus with annotated phases (data=synthetic, data=uci_phases); or, for"
        " model=multi_adversary, give a classifier that was trained on one:"
        " model.classifier=FILE, the phase_classifier.pt in the folder of a run of"
        " model=phase_classifier",
    ),
}
"""What a corpus can lack: how it is called, and what would help."""


def fields_of(names: Iterable[str]) -> list[Field]:
    """The fields of some names, in the names' order.

    Raises:
        ConfigError: A name that is no field's; there are those of `FIELDS`.
    """
    names = sorted(names)
    if unknown := [name for name in names if name not in FIELDS]:
        raise ConfigError(f"no batch field {', '.join(unknown)}; there are {', '.join(FIELDS)}")
    return [FIELDS[name] for name in names]


def refuse_lacking(
    who: str, needs: Iterable[str], corpus: str, lacks: Iterable[FieldSource]
) -> None:
    """Refuse fields that a corpus can't fill.

    Args:
        who: Whose they are, for the message.
        needs: Names of fields.
        corpus: Its name.
        lacks: What none of its recordings has.

    Raises:
        ConfigError: One can't be filled, with what would help, or is no field.
    """
    fields, lacks = fields_of(needs), set(lacks)
    lacking, hints = list[str](), list[str]()
    for source in (source for source in _LACKING if source in lacks):
        if names := [f.name for f in fields if f.reads == source and not f.has_padding]:
            what, hint = _LACKING[source]
            lacking.append(f"{what} (the field {', '.join(names)})")
            hints.append(hint)
    if lacking:
        told = " and ".join(lacking)
        raise ConfigError(f"{who} needs {told}, and {corpus} has none", "; ".join(hints))
