"""What people write for the nine gesture phases."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

from cospeech.errors import ConfigError
from cospeech.motion.phases import PHASES

_SYNONYMS: dict[str, str] = {
    "preparation": "prep, preparatory, preparacao, preparacion, preparazione, vorbereitung",
    "pre_hold": "prehold, pre stroke hold, prestroke hold, pre stroke, prestroke",
    "stroke": "",
    "hold": "post stroke hold, poststroke hold, post stroke, poststroke, post hold, posthold",
    "independent_hold": "indep hold, stroke hold, hold stroke",
    "rest_hold": "rest, resting, rest pose, rest position, rest posture, descanso, repouso",
    "partial_retract": "partial retraction, partial recovery, retract partial, partial retr,"
    " semi retraction",
    "retract": "retraction, recovery, retr, retracao, retraccion",
    "none": "no gesture, non gesture, nongesture, no phase, nothing, null",
}
"""Label -> what else it is called, as `normalised` writes it.

Kita, van Gijn and van der Hulst (1998) call a held meaningful pose an independent hold, McNeill a
stroke hold; Kendon's recovery is the retraction. A rest between gestures is the nine-label scheme's
rest hold: "none" is for hands that hang down or do something else."""


def normalised(text: str) -> str:
    """Lower case, without accents, with single spaces for all that is no letter or digit.

    Text that has neither stays as it is.
    """
    decomposed = unicodedata.normalize("NFKD", text)
    letters = "".join(letter for letter in decomposed if not unicodedata.combining(letter))
    return re.sub(r"[\W_]+", " ", letters.casefold()).strip() or text.strip()


_MEANINGS = {normalised(label): label for label in PHASES} | {
    synonym: label
    for label, synonyms in _SYNONYMS.items()
    for synonym in filter(None, map(str.strip, synonyms.split(",")))
}


def phase_meanings(labels: Mapping[str, str] | None = None) -> dict[str, str]:
    """What each label means, as `normalised` writes it.

    Args:
        labels: A user's own: text in the file -> name in `PHASES`. They go before the known ones.

    Raises:
        ConfigError: A value is not one of the nine phases.
    """
    for text, label in (labels or {}).items():
        if label not in PHASES:
            raise ConfigError(
                f"the label {text!r} can't mean {label!r}: the phases are {', '.join(PHASES)}",
                "correct data.phase_labels",
            )
    return _MEANINGS | {normalised(text): label for text, label in (labels or {}).items()}
