"""Table 3 of Habibie et al. 2022 for a trained run, with the paper's searches beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.methods.base import GestureMethod
from cospeech.methods.motion_matching import MotionMatching
from cospeech.methods.motion_matching.matched import K_NN, MatchedMethod
from cospeech.metrics.encoder import GestureEncoder
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from cospeech.studies.synchrony import SpeechToMotion, synchrony

SEARCHES: dict[str, dict[str, Any]] = {
    "k-NN pose-only": {"preselect": "pose_only"},
    "k-NN audio pre-selected": {"preselect": "audio"},
    "k-NN pose pre-selected": {"preselect": "pose"},
}
"""The paper's searches, by how they differ from one another.

The pose-only one searches every 8 frames like the others. The paper's text has it search at every
frame; without anything heard, that goes to and fro between two frames for ever.
"""


def matching_synchrony(
    store: Store,
    encoder: GestureEncoder,
    method: GestureMethod,
    split: str,
    folder: Path,
    seed: int,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Measure the paper's searches and what a run makes of one of them, on the same speech.

    Args:
        store: The corpus of the run.
        encoder: The common evaluation space.
        method: A run of motion matching.
        split: The part to judge on.
        folder: Where the files of `synchrony` go.
        seed: Of first poses, mismatch and resampling.
        about: What else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: The run is of another method.
    """
    if not isinstance(method, MatchedMethod):
        raise CospeechError(
            f"a {type(method).__name__} searches no database",
            "give a run of model=knn or model=knn_cgan",
        )
    facts, same = store.facts(), method.same_speaker
    systems = {
        name: _speaking(MotionMatching(facts, same_speaker=same, **settings), seed)
        for name, settings in SEARCHES.items()
    }
    speech = Speech(store.speech(store.splits[split][0]).waveform[:16_000])
    *_, last = method.stages(speech, None, torch.Generator().manual_seed(seed))
    name = last if last != K_NN else "the run's own search"
    systems[name] = _speaking(method, seed)
    return synchrony(store, encoder, split, folder, systems, seed, about=about)


def _speaking(method: MatchedMethod, seed: int) -> SpeechToMotion:
    def speak(speech: Speech, speaker: str) -> Motion:
        generator = torch.Generator().manual_seed(seed)
        known = speaker if speaker in method.speakers else None
        poses = list(method.stages(speech, None, generator, known).values())[-1]
        return Motion(UPPER_BODY, method.window.fps, method.database.upper_body(poses))

    return speak
