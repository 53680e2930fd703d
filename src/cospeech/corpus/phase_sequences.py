"""Velocities at 20 fps with a gesture phase per step, from the recordings of a store."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import (
    BodyJoints,
    body_positions,
    mirrored_velocities,
    velocities,
    wrists,
)

STEP_FPS = 20.0
"""Steps per second of the phase classifier (Ferstl et al. 2020, section 4)."""


@dataclass(frozen=True)
class Piece:
    """A stretch of one recording.

    Attributes:
        recording: Index in the store.
        start_s: s.
        stop_s: s; infinity for the recording's end.
    """

    recording: int
    start_s: float = 0.0
    stop_s: float = math.inf


@dataclass(frozen=True, eq=False)
class PhaseSequence:
    """One of the interleaved 20 fps sequences of a piece.

    Attributes:
        recording: Index in the store.
        interleave: Which of the sequences of its piece.
        times_s: ``(T,)`` time of each step in the recording, s.
        features: ``(T, C)`` float32: velocities in metres per second (see
            `cospeech.motion.velocities.velocities`), and whatever is appended to them.
        labels: ``(T,)`` int8 indices into `cospeech.motion.phases.PHASES`.
        joints: The joints of the features.
        speeds: Whether the features have speeds.
    """

    recording: int
    interleave: int
    times_s: NDArray[np.float64]
    features: NDArray[np.float32]
    labels: NDArray[np.int8]
    joints: BodyJoints
    speeds: bool

    def mirrored(self) -> PhaseSequence:
        """The same gestures made by the person in the mirror; appended features stay."""
        features = torch.from_numpy(self.features)
        return replace(
            self, features=mirrored_velocities(features, self.joints, self.speeds).numpy()
        )


def pieces_of(store: Store, split: str) -> list[Piece]:
    """The annotated stretches of one split of a store.

    Raises:
        CospeechError: There are none.
    """
    pieces = []
    for span in store.splits[split]:
        recording = store.recordings[span.recording]
        if recording.has_phases:
            whole = span.stop >= recording.frames
            stop = math.inf if whole else span.stop / EVALUATION_FPS
            pieces.append(Piece(span.recording, span.start / EVALUATION_FPS, stop))
    if not pieces:
        raise CospeechError(
            f"{store.name}: no {split} recording has gesture phases",
            "use a corpus with annotated phases: data=synthetic or data=uci_phases",
        )
    return pieces


def phase_sequences(
    store: Store,
    pieces: Sequence[Piece],
    *,
    select: Callable[[Skeleton], BodyJoints] = wrists,
    speeds: bool = True,
    smoothing_s: float = 0.0,
) -> list[PhaseSequence]:
    """Velocities and labels of pieces of annotated recordings.

    A motion whose rate is a multiple of 20 fps gives so many interleaved sequences (60 fps: three)
    without a frame interpolated; another is first put on the next multiple. Nothing crosses the
    edge of a piece: smoothing and differences begin anew in each.

    Args:
        store: The corpus.
        pieces: E.g. from `pieces_of`.
        select: The joints wanted, by the recording's skeleton.
        speeds: Whether each joint's speed is a feature.
        smoothing_s: Standard deviation of a Gaussian low-pass of the positions, s; 0: none. The
            same for every corpus that one classifier sees.

    Returns:
        Piece by piece, interleave by interleave. A step's velocity leads to it from the one before,
        so the first frame of an interleave has none.

    Raises:
        CospeechError: A recording has no phases, or its skeleton lacks a joint.
    """
    sequences = []
    for piece in pieces:
        labels = store.phases(piece.recording)
        if labels is None:
            name = store.recordings[piece.recording].id
            raise CospeechError(f"recording {name} has no gesture phases")
        motion = store.motion(piece.recording)
        joints = select(motion.skeleton)
        sequences += _interleaved(piece, motion, labels, joints, speeds, smoothing_s)
    return sequences


def _interleaved(
    piece: Piece,
    motion: Motion,
    labels: NDArray[np.int8],
    joints: BodyJoints,
    speeds: bool,
    smoothing_s: float,
) -> list[PhaseSequence]:
    first = math.ceil(piece.start_s * motion.fps - 1e-6)
    stop = min(len(motion), math.ceil(min(piece.stop_s, motion.duration) * motion.fps - 1e-6))
    positions = body_positions(motion.slice(first, stop), joints)
    labels = np.array(labels[first:stop])
    count = math.ceil(motion.fps / STEP_FPS - 1e-6)
    rate = count * STEP_FPS
    if not math.isclose(rate, motion.fps, rel_tol=1e-6) and len(positions):
        positions = resample_positions(positions, motion.fps, rate)
        nearest = np.rint(np.arange(len(positions)) * motion.fps / rate).astype(np.int64)
        labels = labels[nearest.clip(max=len(labels) - 1)]
    if smoothing_s > 0:
        positions = gaussian_filter1d(positions, smoothing_s * rate, axis=0, mode="nearest")
    times = first / motion.fps + np.arange(len(positions)) / rate
    return [
        PhaseSequence(
            recording=piece.recording,
            interleave=interleave,
            times_s=times[interleave::count][1:],
            features=velocities(
                torch.from_numpy(positions[interleave::count]), STEP_FPS, speeds
            ).numpy(),
            labels=labels[interleave::count][1:],
            joints=joints,
            speeds=speeds,
        )
        for interleave in range(count)
        if len(positions) > interleave + count
    ]
