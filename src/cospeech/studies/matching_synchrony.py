"""Table 3 of Habibie et al. 2022 for a trained run, with the paper's searches beside it."""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any

import torch

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import fit_database
from cospeech.matching.synthesis import MatchingSettings, MotionMatcher
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import MakesStages
from cospeech.metrics.encoder import GestureEncoder
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from cospeech.studies.synchrony import SpeechToMotion, synchrony

SEARCHES = {
    "k-NN pose-only": MatchingSettings(preselect="pose_only"),
    "k-NN audio pre-selected": MatchingSettings(preselect="audio"),
    "k-NN pose pre-selected": MatchingSettings(preselect="pose"),
}
"""The paper's searches.

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
    if not isinstance(method, MakesStages):
        raise CospeechError(
            f"a {type(method).__name__} searches no database",
            "give a run of model=knn or model=knn_cgan",
        )
    database = fit_database(store, MatchingSpec())
    systems = {
        name: _searching(MotionMatcher(database, settings), method.same_speaker, seed)
        for name, settings in SEARCHES.items()
    }
    speech = Speech(store.speech(store.splits[split][0]).waveform[:16_000])
    stages = list(method.stages(speech, None, torch.Generator().manual_seed(seed)))
    systems[stages[-1] if len(stages) > 1 else "the run's own search"] = _speaking(
        method, store.speaker_ids, seed
    )
    return synchrony(store, encoder, split, folder, systems, seed, about=about)


def _searching(matcher: MotionMatcher, same_speaker: bool, seed: int) -> SpeechToMotion:
    def speak(speech: Speech, speaker: str) -> Motion:
        generator = torch.Generator().manual_seed(seed)
        database = matcher.database
        closed = database.of_others(speaker, generator) if same_speaker else None
        poses = matcher(speech, None, generator, closed).poses
        return Motion(UPPER_BODY, database.spec.fps, database.upper_body(poses))

    return speak


def _speaking(method: GestureMethod, known: Container[str], seed: int) -> SpeechToMotion:
    def speak(speech: Speech, speaker: str) -> Motion:
        generator = torch.Generator().manual_seed(seed)
        named = speaker if speaker in known else None
        return method.generate(speech, named, generator=generator)

    return speak
