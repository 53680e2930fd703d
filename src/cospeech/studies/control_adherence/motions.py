"""Motion for every recording, with and without controls, as the quantities that are judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.matching.control import measure
from cospeech.matching.tracks import MatchingTracks
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import MakesStages
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.studies.control_adherence.tested_controls import QUANTITIES, TESTED_CONTROLS, changing

FREE, CHANGING = "uncontrolled", "slow and low, then fast and high"

Values = NDArray[np.float64]
Series = dict[str, list[Values]]
"""Quantity -> its values in each recording, ``(F,)``."""


@dataclass(frozen=True, eq=False)
class Made:
    """All motion of a study.

    Attributes:
        names: Of the recordings.
        closed: For each, the sequences that its motion isn't taken from; None for none.
        real: What was recorded.
        motions: Name of the control (`FREE`, of `TESTED_CONTROLS`, `CHANGING`) -> stage -> series.
    """

    names: list[str]
    closed: list[NDArray[np.int64] | None]
    real: Series
    motions: dict[str, dict[str, Series]]

    @property
    def stages(self) -> list[str]:
        """The method's stages, in order."""
        return list(self.motions[FREE])


@torch.no_grad()
def make_motions(store: Store, method: GestureMethod, split: str, seed: int) -> Made:
    """Motion for all recordings of a split under every control.

    The same first pose is drawn for a recording under every control, as far as the control allows.

    Raises:
        CospeechError: The method has no stages, or no recording has sound.
    """
    if not isinstance(method, MakesStages):
        raise CospeechError(
            f"a {type(method).__name__} takes no controls",
            "give a run of model=knn or model=knn_cgan",
        )
    training = method.training
    method.eval()
    database = method.matcher.database
    fps = database.spec.fps
    tracks = MatchingTracks(store, split, fps)
    names: list[str] = []
    closed: list[NDArray[np.int64] | None] = []
    real: Series = {quantity: [] for quantity in QUANTITIES}
    tested = {a.name: a.controls() for a in TESTED_CONTROLS}
    motions: dict[str, dict[str, Series]] = {name: {} for name in (FREE, *tested, CHANGING)}
    for number, track in enumerate(tracks):
        recording = store.recordings[track.span.recording]
        names.append(recording.id)
        drawn = torch.Generator().manual_seed(1000 * seed + number)
        closed.append(method.closed_sequences(recording.speaker, drawn))
        for quantity in QUANTITIES:
            real[quantity].append(measure(quantity, track.poses, tracks.pose_roles, fps))
        speech = store.speech(track.span)
        seconds = len(speech.waveform) / SAMPLE_RATE
        wanted = {FREE: None, **tested, CHANGING: changing(seconds)}
        for name, controls in wanted.items():
            generator = torch.Generator().manual_seed(1000 * seed + number)
            made = method.stages(speech, controls, generator, recording.speaker)
            for stage, poses in made.items():
                series = motions[name].setdefault(stage, {q: [] for q in QUANTITIES})
                for quantity in QUANTITIES:
                    series[quantity].append(measure(quantity, poses, database.pose_roles, fps))
    method.train(training)
    return Made(names, closed, real, motions)
