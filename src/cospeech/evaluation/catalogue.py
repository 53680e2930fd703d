"""The metrics of an evaluation, by name, and the row that they make of a system."""

from __future__ import annotations

import copy
import hashlib
import inspect
import json
import sys
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any, Literal

import torch
from torch import Tensor

from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation.intervals import EXTRAPOLATED, interval_of
from cospeech.metrics.acceleration_error import AccelerationError
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.feature_distance import FeatureDistance
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.joint_mae import JointMAE
from cospeech.metrics.kernel_distance import KernelDistance
from cospeech.metrics.window_metric import WindowMetric

Comparison = Literal["pairs", "sets"]


class Catalogue:
    """The metrics of an evaluation.

    Args:
        metrics: Name -> metric, as ``conf/metrics`` names them; they are copied for every use.

    Raises:
        ConfigError: Something in it is no `WindowMetric`.
    """

    def __init__(self, metrics: Mapping[str, WindowMetric]) -> None:
        for name, metric in metrics.items():
            if not isinstance(metric, WindowMetric):
                raise ConfigError(
                    f"metrics.catalogue.{name} is a {type(metric).__name__}, no metric of windows",
                    "derive its class from cospeech.metrics.window_metric.WindowMetric",
                )
        self._metrics = dict(metrics)

    @property
    def needs(self) -> frozenset[str]:
        """Fields of the corpus that the metrics read besides motion."""
        return frozenset().union(*(metric.needs for metric in self._metrics.values()))

    @property
    def fields(self) -> frozenset[str]:
        """Fields of the windows that a method is judged on."""
        return self.needs | {"positions"}

    def described(self) -> list[dict[str, str | None]]:
        """Name, heading and better direction of every column, in order, for a record."""
        columns = list[dict[str, str | None]]()
        for name, metric in self._metrics.items():
            title = f"{metric.title}, {metric.unit}" if metric.unit else metric.title
            better = {True: "higher", False: "lower", None: None}[metric.higher_is_better]
            columns.append({"key": name, "title": title, "better": better})
            if isinstance(metric, FrechetGestureDistance):
                columns.append(dict(EXTRAPOLATED))
        return columns

    @property
    def digest(self) -> str:
        """Changes with the metrics, their settings and the files that define them."""
        said = [
            [name, type(metric).__qualname__, _source(type(metric)), _settings(metric)]
            for name, metric in self._metrics.items()
        ]
        return hashlib.sha256(json.dumps(said).encode()).hexdigest()

    def fresh(self, without: Comparison | None = None) -> dict[str, WindowMetric]:
        """Empty copies of the metrics.

        Args:
            without: Those that compare so are left out; without ``"pairs"``, the windows of both
                sides aren't of the same speech.
        """
        copies = {
            name: copy.deepcopy(metric)
            for name, metric in self._metrics.items()
            if metric.compares != without
        }
        for metric in copies.values():
            metric.are_pairs = without != "pairs"
        return copies

    def row(
        self,
        generated: EvaluationWindows,
        real: EvaluationWindows,
        without: Comparison | None = None,
        recording_ids: Sequence[Hashable] = (),
        seed: int = 0,
    ) -> dict[str, float]:
        """All numbers of one system: what the table prints for it.

        Args:
            generated: Windows of the system, two or more.
            real: What they are compared with: the windows of the same speech, pair by pair, but
                without ``"pairs"``.
            without: See `fresh`.
            recording_ids: The recording of each pair; of two or more recordings, the FGD has an
                interval over them.
            seed: Of the interval's draws.

        Returns:
            The metrics' values by name, ``windows`` and ``windows_real``; with an interval also
            ``fgd_low``, ``fgd_high`` (95 %), ``fgd_extrapolated`` and ``recordings``.
        """
        row = self.row_of_batches([generated], real, without)
        if any(isinstance(m, FrechetGestureDistance) for m in self._metrics.values()):
            row |= interval_of(generated.features, real.features, recording_ids, seed)
        return row

    def row_of_batches(
        self,
        generated: Iterable[EvaluationWindows],
        real: EvaluationWindows,
        without: Comparison | None = None,
    ) -> dict[str, float]:
        """As `row`, without an interval; of many windows that aren't in memory at once.

        Args:
            generated: Batches, one or more; more than one only without ``"pairs"``.
            real: See `row`.
            without: See `fresh`.

        Raises:
            CospeechError: Fewer than two windows on a side.
        """
        metrics, count, side = self.fresh(without), 0, real
        for metric in metrics.values():
            # A row is one process's own work; of a distributed run the others may have gone.
            metric.distributed_available_fn = _by_itself
        for batch in generated:
            for metric in metrics.values():
                metric.update(batch, side)
            count, side = count + len(batch), real[torch.zeros(len(real), dtype=torch.bool)]
        if min(count, len(real)) < 2:
            raise CospeechError(
                f"{count} windows to be compared with {len(real)} real ones: a distribution takes"
                " two or more on each side",
                "add recordings, or longer ones",
            )
        values = {name: float(value) for name, value in values_of(metrics).items()}
        return {**values, "windows": float(count), "windows_real": float(len(real))}


def standard_catalogue() -> Catalogue:
    """The metrics of ``conf/metrics/default.yaml``, for an evaluation without a config."""
    return Catalogue(
        {
            "fgd": FrechetGestureDistance(),
            "kernel_distance": KernelDistance(),
            "feature_distance": FeatureDistance(),
            "joint_mae": JointMAE(),
            "acceleration_error": AccelerationError(),
        }
    )


def values_of(metrics: Mapping[str, WindowMetric]) -> dict[str, Tensor]:
    """What metrics have computed, by name; of one that gives several values, by theirs."""
    values = dict[str, Tensor]()
    for name, metric in metrics.items():
        value = metric.compute()
        values |= value if isinstance(value, dict) else {name: value}
    return values


def _by_itself() -> bool:
    return False


def _source(kind: type) -> str:
    try:
        text = inspect.getsource(sys.modules[kind.__module__])
    except (OSError, TypeError):  # typed into an interpreter
        text = kind.__module__
    return hashlib.sha256(text.encode()).hexdigest()


def _settings(metric: WindowMetric) -> dict[str, Any]:
    return {
        name: value
        for name, value in sorted(vars(metric).items())
        if isinstance(value, (bool, int, float, str)) and not name.startswith("_")
    }
