"""The evaluation space, the numbers of one system in it, and the rows that make them readable.

Methods differ in frame rate and window; all are judged as 34-frame windows of the ten upper-body
joints at 15 fps, every ten frames. A table row can't be read without its reference rows: what two
sets of real motion score against each other, and what known faults cost.
"""

from __future__ import annotations

import logging
from collections.abc import Hashable, Iterable, Sequence

import torch
from torch import Tensor

from cospeech.metrics import disturbances
from cospeech.metrics.encoder import (
    EVALUATION_FPS,
    EVALUATION_FRAMES,
    EVALUATION_STRIDE,
    GestureEncoder,
)
from cospeech.metrics.functional import (
    acceleration_error,
    feature_distance,
    frechet_terms,
    joint_mae,
    kernel_distance,
)
from cospeech.metrics.moments import feature_moments, recording_moments
from cospeech.metrics.uncertainty import fgd_interval
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import UPPER_BODY

PROTOCOL_VERSION = 1
"""Counted up when a row's meaning changes, so that kept rows of an older meaning are not shown."""
NOISE_VARIANCE = 0.001
"""Variance of the noise row, in the units and of the kind of the paper's figure 3 b."""
ATTENUATION = 0.8
"""Amplitude left in the attenuated row."""

_logger = logging.getLogger(__name__)


def to_evaluation_windows(motion: Motion) -> Tensor:
    """Cut a motion into windows of the evaluation space.

    Args:
        motion: Root-relative motion of the upper-body joints, at any frame rate.

    Returns:
        ``(n, 34, 10, 3)`` float32 at 15 fps, window i from frame 10 i on; frames after the last
        full window are left out, and a motion shorter than one window gives none.

    Raises:
        ValueError: Another skeleton than `UPPER_BODY`.
    """
    if motion.skeleton.joints != UPPER_BODY.joints:
        raise ValueError(
            f"evaluation takes the upper-body joints, not skeleton {motion.skeleton.name}"
        )
    positions = torch.from_numpy(resample_positions(motion.positions, motion.fps, EVALUATION_FPS))
    return cut_windows(positions[None])


def cut_windows(positions: Tensor) -> Tensor:
    """Cut positions at the evaluation rate into windows of the evaluation space.

    Args:
        positions: ``(B, T, 10, 3)`` at 15 fps.

    Returns:
        ``(B n, 34, 10, 3)``; of each item the n windows that begin every ten frames.
    """
    if positions.shape[1] < EVALUATION_FRAMES:
        return positions.new_empty(0, EVALUATION_FRAMES, *positions.shape[2:])
    windows = positions.unfold(1, EVALUATION_FRAMES, EVALUATION_STRIDE)
    return windows.movedim(-1, 2).flatten(0, 1)


@torch.no_grad()
def encode(encoder: GestureEncoder, positions: Tensor, batch_size: int = 512) -> Tensor:
    """Features ``(n, 32)``, on the CPU, of windows ``(n, 34, 10, 3)``.

    Raises:
        ValueError: A coordinate is NaN or infinite.
    """
    device = next(encoder.parameters()).device
    batches = [
        encoder.encode_positions(batch.to(device)).cpu() for batch in positions.split(batch_size)
    ]
    return torch.cat(batches)


def unpaired_row(features: Tensor, features_real: Tensor, paired: bool = False) -> dict[str, float]:
    """Distances between two sets of windows as sets.

    Args:
        features: ``(n, 32)`` of the set judged, n >= 2.
        features_real: ``(m, 32)`` of the real set, m >= 2.
        paired: Row i of both belongs to the same speech; matters to the kernel distance alone.

    Returns:
        ``fgd`` and its ``fgd_mean_term`` and ``fgd_covariance_term``, ``kernel_distance``,
        ``windows`` and ``windows_real``.
    """
    terms = frechet_terms(
        *feature_moments(features_real).mean_and_covariance(),
        *feature_moments(features).mean_and_covariance(),
    )
    return {
        "fgd": terms.total.item(),
        "fgd_mean_term": terms.mean_term.item(),
        "fgd_covariance_term": terms.covariance_term.item(),
        "kernel_distance": kernel_distance(features, features_real, paired).item(),
        "windows": float(len(features)),
        "windows_real": float(len(features_real)),
    }


def paired_row(
    encoder: GestureEncoder,
    generated: Tensor,
    real: Tensor,
    recording_ids: Sequence[Hashable],
    seed: int = 0,
) -> dict[str, float]:
    """All numbers of one system: what the table prints for it.

    Args:
        encoder: The frozen encoder.
        generated: ``(n, 34, 10, 3)`` windows of the system.
        real: The real windows of the same speech, pair by pair; both on the CPU.
        recording_ids: The recording of each window.
        seed: Of the interval's draws.

    Returns:
        `unpaired_row`'s values, ``feature_distance``, ``joint_mae`` (metres),
        ``acceleration_error`` (metres per squared frame) and, if there are two recordings or more,
        ``fgd_low``, ``fgd_high`` (95 %, over recordings), ``fgd_extrapolated`` and ``recordings``.
    """
    features, features_real = encode(encoder, generated), encode(encoder, real)
    row = unpaired_row(features, features_real, paired=True)
    row |= _errors(features, features_real, generated, real)
    if len(set(recording_ids)) < 2:
        return row
    interval = fgd_interval(
        recording_moments(features_real, recording_ids),
        recording_moments(features, recording_ids),
        seed=seed,
    )
    return row | {
        "fgd_low": interval.low,
        "fgd_high": interval.high,
        "fgd_extrapolated": interval.extrapolated,
        "recordings": float(interval.recordings),
    }


def _errors(
    features: Tensor, features_real: Tensor, generated: Tensor, real: Tensor
) -> dict[str, float]:
    return {
        "feature_distance": feature_distance(features, features_real).item(),
        "joint_mae": joint_mae(generated, real).item(),
        "acceleration_error": acceleration_error(generated, real).item(),
    }


def reference_rows(
    encoder: GestureEncoder,
    train_positions: Iterable[Tensor],
    eval_positions: Tensor,
    recording_ids: Sequence[Hashable],
    seed: int = 0,
) -> dict[str, dict[str, float]]:
    """The rows that belong beside every system's row; they depend on no system.

    ``real_train``: the training windows against the evaluated ones. ``real_halves``: two halves of
    the evaluated windows that share no recording: the floor that a perfect system would meet at
    that size. ``mismatched``: real motion of another recording. As a set these are the same
    windows, so the distances between sets are trivially 0 and left out. ``mean_pose``: the training
    mean, motionless. ``noise``: joints displaced as in the paper's figure 3 b. ``attenuated``:
    amplitude x 0.8. ``frozen_arms`` and ``time_reversed`` as they say.

    Args:
        encoder: The frozen encoder.
        train_positions: Batches ``(B, 34, 10, 3)`` of training windows; gone through once.
        eval_positions: ``(n, 34, 10, 3)`` real windows of the split that systems are judged on.
        recording_ids: The recording of each of these.
        seed: Of all draws.

    Returns:
        Row name -> values, as `unpaired_row` (the first two) and `paired_row` give them;
        ``mismatched`` has the paired errors only. Without two recordings there is no
        ``real_halves``.

    Raises:
        ValueError: Fewer than two training or evaluation windows.
    """
    pose_sum, frames, train_features = torch.zeros(len(UPPER_BODY), 3, dtype=torch.float64), 0, []
    for batch in train_positions:
        pose_sum += batch.double().sum((0, 1)).cpu()
        frames += batch.shape[0] * batch.shape[1]
        train_features.append(encode(encoder, batch))
    if min(sum(map(len, train_features)), len(eval_positions)) < 2:
        raise ValueError("reference rows need two training and two evaluation windows or more")
    mean_pose = (pose_sum / frames).float()
    generator = torch.Generator().manual_seed(seed)
    eval_features = encode(encoder, eval_positions)

    rows = {"real_train": unpaired_row(torch.cat(train_features), eval_features)}
    halves = _halves(recording_ids, generator)
    if halves is None:
        _logger.warning(
            "no real-versus-real floor and no intervals: they take two recordings with two windows"
        )
    else:
        rows["real_halves"] = unpaired_row(eval_features[halves], eval_features[~halves])
    other = _other_recording(recording_ids, generator)
    rows["mismatched"] = _errors(
        eval_features[other], eval_features, eval_positions[other], eval_positions
    ) | {"windows": float(len(eval_features))}
    scale = disturbances.published_scale(eval_positions)
    systems = {
        "mean_pose": mean_pose.expand_as(eval_positions),
        "noise": disturbances.gaussian(eval_positions, NOISE_VARIANCE, scale, generator),
        "attenuated": disturbances.multiplicative(eval_positions, ATTENUATION, mean_pose),
        "frozen_arms": disturbances.frozen_arms(eval_positions),
        "time_reversed": disturbances.time_reversed(eval_positions),
    }
    for name, positions in systems.items():
        rows[name] = paired_row(encoder, positions, eval_positions, recording_ids, seed)
    return rows


def _recording_numbers(recording_ids: Sequence[Hashable]) -> Tensor:
    numbers: dict[Hashable, int] = {}
    return torch.tensor([numbers.setdefault(key, len(numbers)) for key in recording_ids])


def _halves(recording_ids: Sequence[Hashable], generator: torch.Generator) -> Tensor | None:
    """A mask of windows whose recordings make up about half of all windows, or None."""
    numbers = _recording_numbers(recording_ids)
    counts = torch.bincount(numbers)
    order = torch.randperm(len(counts), generator=generator)
    ends = counts[order].cumsum(0)
    cut = int((ends - len(numbers) / 2).abs()[:-1].argmin()) + 1 if len(counts) > 1 else 0
    mask = torch.isin(numbers, order[:cut])
    return mask if min(int(mask.sum()), int((~mask).sum())) >= 2 else None


def _other_recording(recording_ids: Sequence[Hashable], generator: torch.Generator) -> Tensor:
    """A permutation of the windows that moves each to another recording.

    With the windows sorted by recording, a shift by the longest recording's count does so unless
    that recording holds more than half of them.
    """
    numbers = _recording_numbers(recording_ids)
    counts = torch.bincount(numbers)
    rank = torch.randperm(len(counts), generator=generator)
    windows = torch.argsort(rank[numbers], stable=True)
    shift = min(int(counts.max()), len(numbers) // 2)
    permutation = torch.empty_like(windows)
    permutation[windows] = windows.roll(shift)
    return permutation
