"""Reading the gesture phases of one annotation file."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from cospeech.errors import ContentError, InputFileError
from cospeech.foreign import understood
from cospeech.formats.phase_files.anvil import read_anvil
from cospeech.formats.phase_files.elan import read_elan
from cospeech.formats.phase_files.hands import are_hands, busier_hand
from cospeech.formats.phase_files.labels import normalised, phase_meanings
from cospeech.formats.phase_files.table import read_phase_table
from cospeech.formats.phase_files.tiers import Entry, Tier
from cospeech.motion.phases import PHASES, PhaseSegment
from cospeech.quoting import setting

_READERS: dict[str, Callable[[Path], list[Tier]]] = {
    ".anvil": read_anvil,
    ".eaf": read_elan,
    ".csv": read_phase_table,
    ".tsv": read_phase_table,
    ".txt": read_phase_table,
}

_log = logging.getLogger(__name__)


def read_phases(
    path: str | Path, tier: str | None = None, labels: Mapping[str, str] | None = None
) -> list[PhaseSegment]:
    """Gesture phases from an ANVIL (.anvil), ELAN (.eaf) or table (.csv, .tsv, .txt) file.

    Labels are read whatever their case, accents and punctuation, by the names of the literature
    (``prep``, ``post-stroke hold``, ``recovery``, ``Preparação`` ...). A blank label and an
    annotation without length are passed over.

    Args:
        path: The file.
        tier: The tier (ELAN), or the track or ``track:attribute`` (ANVIL), that holds the phases;
            None: the one whose every label is a phase. Where that holds of two, and their names
            differ by left and right alone, they are one per hand: at any time the phase of the
            hand that does more counts (`busier_hand`).
        labels: What the file's own labels mean: text -> name in `PHASES`.

    Returns:
        Segments in order of their start, with names of `PHASES`. `frame_phases` makes labels of
        frames of them.

    Raises:
        InputFileError: The file is damaged, no tier or several could be meant, a label is unknown,
            or an annotation ends before it starts.
        CospeechError: A value of ``labels`` is no phase.
    """
    path = Path(path)
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise InputFileError(path, f"not an annotation file; there are {', '.join(_READERS)}")
    meanings = phase_meanings(labels)
    with understood(path, "an annotation file"):
        chosen = _choose(read(path), tier, meanings)
        hands = [_segments(path, one, meanings) for one in chosen]
    return hands[0] if len(hands) == 1 else busier_hand(hands)


def _segments(path: Path, tier: Tier, meanings: Mapping[str, str]) -> list[PhaseSegment]:
    segments = []
    for entry in _written(tier):
        if entry.end_s < entry.start_s:
            raise ContentError(
                f"ends at {entry.end_s:g} s, before it starts at {entry.start_s:g} s",
                entry.place,
            )
        if entry.end_s > entry.start_s:
            label = meanings[normalised(entry.text)]
            segments.append(PhaseSegment(entry.start_s, entry.end_s, label))
    if left_out := len(tier.entries) - len(segments):
        _log.info("%s: %d annotations without label or length", path, left_out)
    return sorted(segments, key=lambda segment: segment.start_s)


def _written(tier: Tier) -> list[Entry]:
    return [entry for entry in tier.entries if entry.text]


def _choose(tiers: Sequence[Tier], wanted: str | None, meanings: Mapping[str, str]) -> list[Tier]:
    """The tier of the phases, or one per hand."""
    tiers = [tier for tier in tiers if tier.problem or _written(tier)]
    names = ", ".join(repr(tier.name) for tier in tiers)
    if not tiers:
        raise ContentError("holds no annotation")
    if wanted is not None:
        tiers = [tier for tier in tiers if wanted in (tier.name, tier.track)]
        if not tiers:
            raise ContentError(
                f"no tier {wanted!r} with annotations; there are {names}",
                hint="choose one of them (data.phase_tier)",
            )
    timed = [tier for tier in tiers if not tier.problem]
    if not timed:
        raise ContentError(tiers[0].problem, f"tier {tiers[0].name}")
    unknown = {
        tier.name: [entry for entry in _written(tier) if normalised(entry.text) not in meanings]
        for tier in timed
    }
    fitting = [tier for tier in timed if not unknown[tier.name]]
    if len(fitting) == 1 or are_hands([tier.name for tier in fitting]):
        return fitting
    if fitting:
        several = ", ".join(repr(tier.name) for tier in fitting)
        raise ContentError(
            f"several tiers hold gesture phases: {several}",
            hint=f"choose one: {setting('data.phase_tier', fitting[0].name)}",
        )
    if len(timed) == 1:
        first = unknown[timed[0].name][0]
        raise ContentError(
            f"{first.text!r} is not a gesture phase; known are {', '.join(PHASES)} and what they"
            " are called in the literature",
            first.place,
            hint=f"say what it means: {_meaning(first)}",
        )
    examples = "; ".join(f"{tier.name!r} has {unknown[tier.name][0].text!r}" for tier in timed[:8])
    raise ContentError(
        f"no tier holds gesture phases alone: {examples}",
        hint=f"name the tier ({setting('data.phase_tier', timed[0].name)}), and what its labels"
        f" mean ({_meaning(unknown[timed[0].name][0])}); phases are {', '.join(PHASES)}",
    )


def _meaning(entry: Entry) -> str:
    """How to say what an annotation's label means."""
    text = normalised(entry.text)  # case, accents and marks make no difference
    try:
        return setting("data.phase_labels", {text: "stroke"})
    except ValueError:
        key = json.dumps(text, ensure_ascii=False)
        return f"phase_labels: {{{key}: stroke}} in conf/data/NAME.yaml, where data=NAME"
