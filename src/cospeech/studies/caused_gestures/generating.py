"""Motion for the speech of the judged takes: recorded, mismatched, motionless and generated."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.evaluation import generated_motions
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.studies.caused_gestures.measuring import SystemMotion
from cospeech.studies.caused_gestures.strokes import Take
from cospeech.studies.trained_system import TrainedSystem

RECORDED = "recorded motion"
MISMATCHED = "recorded, mismatched speech"
MEAN_POSE = "mean pose"

PARTNERS = 3
"""Other takes whose motion each take's speech is given, fewer where there are fewer."""

_logger = logging.getLogger(__name__)


def reference_motions(takes: Sequence[Take], training: Sequence[Take]) -> list[list[SystemMotion]]:
    """The rows that belong above every system's: what is perfect, and what knows nothing.

    Args:
        takes: Are judged.
        training: Takes of the training part.

    Returns:
        Recorded motion; recorded motion of other takes of the same speaker, one member per partner,
        from the beginning again where it is shorter, and left out where nobody has another take;
        and the motionless mean of the training part.
    """
    rows = [[SystemMotion(RECORDED, None, [take.positions for take in takes])]]
    everyone = [*takes, *training]
    others = [[other.positions for other in everyone if _is_partner(take, other)] for take in takes]
    if all(others):
        rows.append(
            [
                SystemMotion(
                    MISMATCHED,
                    None,
                    [
                        np.resize(of_speaker[i % len(of_speaker)], take.positions.shape)
                        for take, of_speaker in zip(takes, others, strict=True)
                    ],
                )
                for i in range(min(PARTNERS, max(map(len, others))))
            ]
        )
    else:
        _logger.warning("some speaker has one take alone, so there is no row of mismatched speech")
    mean = np.mean(np.concatenate([take.positions for take in training]), axis=0)
    still = [np.broadcast_to(mean, take.positions.shape) for take in takes]
    return [*rows, [SystemMotion(MEAN_POSE, None, still)]]


def _is_partner(take: Take, other: Take) -> bool:
    return other.speaker == take.speaker and other.span.recording != take.span.recording


def generated_motion(system: TrainedSystem, store: Store, takes: Sequence[Take]) -> SystemMotion:
    """What a trained system makes for the takes' speech alone, take i from seed i.

    Args:
        system: On any skeleton that has a joint map, at any frame rate.
        store: The corpus.
        takes: Whose speech it hears.

    Raises:
        CospeechError: Its motion doesn't cover the speech.
    """
    title = f"{system.name}, seed {system.seed}"
    motions = generated_motions(system.method, store, [take.span for take in takes], title)
    found = [_as_long_as(take, motion, title) for take, motion in zip(takes, motions, strict=True)]
    return SystemMotion(system.name, system.seed, found)


def _as_long_as(take: Take, motion: Motion, title: str) -> NDArray[np.float32]:
    """At the evaluation rate, with the take's frames."""
    positions = resample_positions(motion.positions, motion.fps, EVALUATION_FPS)
    frames = len(take.positions)
    missing = frames - len(positions)
    # The last frame of a slower motion may be up to a frame before the end of the speech.
    if missing > np.ceil(EVALUATION_FPS / motion.fps):
        raise CospeechError(
            f"{title}: {motion.duration:.2f} s of motion for {take.name}, which lasts"
            f" {frames / EVALUATION_FPS:.2f} s"
        )
    return np.pad(positions[:frames], ((0, max(0, missing)), (0, 0), (0, 0)), mode="edge")
