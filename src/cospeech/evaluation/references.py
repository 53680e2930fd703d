"""The reference rows: what makes a system's numbers readable.

A table row can't be read without them: what two sets of real motion score against each other, and
what known faults cost.
"""

from __future__ import annotations

import logging
from collections.abc import Hashable, Iterable, Iterator, Sequence
from pathlib import Path

import torch
from torch import Tensor

from cospeech.corpus.splits import in_groups
from cospeech.corpus.store import Store
from cospeech.errors import InputFileError
from cospeech.evaluation.catalogue import Catalogue
from cospeech.evaluation.real_windows import (
    encoded_windows,
    judged_windows,
    long_enough,
    real_windows,
    with_fields,
)
from cospeech.foreign import read_json, understood
from cospeech.metrics import disturbances
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.motion.upper_body import EVALUATION_FRAMES, UPPER_BODY
from cospeech.reporting.record import write_json

logger = logging.getLogger(__name__)

References = dict[str, dict[str, float]]
"""Row name -> metric name -> value."""

PROTOCOL_VERSION = 1
"""Counted up when a row's meaning changes, so that kept rows of an older meaning are not shown."""
NOISE_VARIANCE = 0.001
"""Variance of the noise row, in the units and of the kind of the paper's figure 3 b."""
ATTENUATION = 0.8
"""Amplitude left in the attenuated row."""
FRAMES_AT_ONCE = 10_000
"""Training frames in memory together: to encode a short span by itself is slow."""


def reference_rows(
    store: Store, encoder: GestureEncoder, split: str, seed: int, catalogue: Catalogue
) -> References:
    """The split's reference rows, computed once per store, encoder and metrics, and kept there.

    Args:
        store: The corpus.
        encoder: The evaluation space.
        split: ``"val"`` or ``"test"``.
        seed: Of the rows' noise and mismatch.
        catalogue: The metrics; recordings that lack what they read are left out.
    """
    made = f"{encoder.sha256[:12]}-{catalogue.digest[:8]}-s{seed}-v{PROTOCOL_VERSION}"
    path = store.path / "references" / f"{split}-{made}.json"
    kept = read_rows(path)
    if kept is not None:
        return kept
    needs = catalogue.needs
    judged = with_fields(store, split, store.splits[split], needs)
    real, ids = judged_windows(store, split, judged, encoder, needs)
    heard = with_fields(store, "train", long_enough(store, "train"), needs)
    train = (
        encoded_windows(store, "train", spans, real_windows(store, spans)[0], encoder, needs)
        for spans in in_groups(heard, FRAMES_AT_ONCE)
    )
    rows = rows_of(encoder, train, real, ids, seed, catalogue)
    write_json(path, rows)
    return rows


def read_rows(path: Path) -> References | None:
    """Reference rows that were kept; None, with a warning where the file is damaged, if none are.

    Args:
        path: What `reference_rows` wrote.
    """
    if not path.is_file():
        return None
    try:
        rows = read_json(path, "reference rows")
        with understood(path, "reference rows"):
            values = [value for row in rows.values() for value in row.values()]
        if not values or not all(type(v) in (float, int, type(None)) for v in values):
            raise InputFileError(path, "holds no rows of numbers")
    except InputFileError as error:
        logger.warning("%s: %s; the reference rows are computed again", path, error.problem)
        return None
    found: References = rows
    return found


def rows_of(
    encoder: GestureEncoder,
    train: Iterable[EvaluationWindows],
    real: EvaluationWindows,
    recording_ids: Sequence[Hashable],
    seed: int,
    catalogue: Catalogue,
) -> References:
    """The rows that belong beside every system's row; they depend on no system.

    ``real_train``: the training windows against the evaluated ones. ``real_halves``: two halves of
    the evaluated windows that share no recording: the floor that a perfect system would meet at
    that size. ``mismatched``: real motion of another recording. As a set these are the same
    windows, so the distances between sets are trivially 0 and left out. ``mean_pose``: the training
    mean, motionless. ``noise``: joints displaced as in the paper's figure 3 b. ``attenuated``:
    amplitude x 0.8. ``frozen_arms`` and ``time_reversed`` as they say.

    Args:
        encoder: The frozen encoder.
        train: Training windows in batches; gone through once.
        real: Real windows of the split that systems are judged on.
        recording_ids: The recording of each of these.
        seed: Of all draws.
        catalogue: The metrics.

    Returns:
        Row name -> values, as `Catalogue.row` gives them; the first two, which aren't pairs,
        without the metrics of pairs. Without two recordings there is no ``real_halves``.

    Raises:
        CospeechError: Fewer than two training windows.
    """
    pose_sum = torch.zeros(len(UPPER_BODY), 3, dtype=torch.float64)

    def summed() -> Iterator[EvaluationWindows]:
        for batch in train:
            pose_sum.add_(batch.positions.double().sum((0, 1)))
            yield batch

    rows = {"real_train": catalogue.row_of_batches(summed(), real, without="pairs")}
    mean_pose = (pose_sum / (rows["real_train"]["windows"] * EVALUATION_FRAMES)).float()
    generator = torch.Generator().manual_seed(seed)
    halves = _halves(recording_ids, generator)
    if halves is None:
        logger.warning(
            "no real-versus-real floor and no intervals: they take two recordings with two windows"
        )
    else:
        rows["real_halves"] = catalogue.row(real[halves], real[~halves], without="pairs")
    other = real[_other_recording(recording_ids, generator)].as_if_of(real)
    rows["mismatched"] = catalogue.row(other, real, without="sets")
    scale = disturbances.published_scale(real.positions)
    systems = {
        "mean_pose": mean_pose.expand_as(real.positions),
        "noise": disturbances.gaussian(real.positions, NOISE_VARIANCE, scale, generator),
        "attenuated": disturbances.multiplicative(real.positions, ATTENUATION, mean_pose),
        "frozen_arms": disturbances.frozen_arms(real.positions),
        "time_reversed": disturbances.time_reversed(real.positions),
    }
    for name, positions in systems.items():
        moved = real.moving(positions, encoder.encode_all(positions))
        rows[name] = catalogue.row(moved, real, recording_ids=recording_ids, seed=seed)
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
