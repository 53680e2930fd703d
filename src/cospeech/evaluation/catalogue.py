"""The metrics of an evaluation, by name, and the row that they make of a system."""

from __future__ import annotations

import copy
import logging
import traceback
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from cospeech.errors import CospeechError
from cospeech.evaluation.declarations import RESERVED, refuse_undeclared
from cospeech.evaluation.digest import digest_of
from cospeech.evaluation.intervals import EXTRAPOLATED, INTERVAL_OF, interval_of
from cospeech.metrics.acceleration_error import AccelerationError
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.feature_distance import FeatureDistance
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.joint_mae import JointMAE
from cospeech.metrics.kernel_distance import KernelDistance
from cospeech.metrics.motion_statistics import Acceleration, Jerk
from cospeech.metrics.window_metric import VALUE, Comparison, WindowMetric

logger = logging.getLogger(__name__)


class Catalogue:
    """The metrics of an evaluation.

    Args:
        metrics: Name -> metric, as ``conf/metrics`` names them; they are copied for every use.

    Raises:
        ConfigError: See `refuse_undeclared`.
    """

    def __init__(self, metrics: Mapping[str, WindowMetric]) -> None:
        refuse_undeclared(metrics)
        self._metrics = dict(metrics)

    @property
    def metrics(self) -> Mapping[str, WindowMetric]:
        """Name -> metric, to be looked at."""
        return self._metrics

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
            better = {True: "higher", False: "lower", None: None}[metric.higher_is_better]
            titles = {name: metric.title}
            titles |= {f"{name}_{part}": title for part, title in metric.parts.items()}
            for key, title in titles.items():
                told = f"{title}, {metric.unit}" if metric.unit else title
                columns.append({"key": key, "title": told, "better": better})
            if name == INTERVAL_OF and self._has_interval:
                columns.append(dict(EXTRAPOLATED))
        return columns

    @property
    def _has_interval(self) -> bool:
        return isinstance(self._metrics.get(INTERVAL_OF), FrechetGestureDistance)

    @cached_property
    def digest(self) -> str:
        """Changes with the metrics, their settings and the code that defines them."""
        return digest_of(self._metrics)

    def fresh(self, without: Comparison | None = None) -> Measurement:
        """The metrics with nothing added yet.

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
        return Measurement(copies)

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
        if self._has_interval:
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
        measurement, count, side = self.fresh(without), 0, real
        measurement.stay_alone()
        for batch in generated:
            measurement.update(batch, side)
            count, side = count + len(batch), real[torch.zeros(len(real), dtype=torch.bool)]
        if min(count, len(real)) < 2:
            raise CospeechError(
                f"{count} windows to be compared with {len(real)} real ones: a distribution takes"
                " two or more on each side",
                "add recordings, or longer ones",
            )
        values = {name: float(value) for name, value in measurement.compute().items()}
        return {**values, "windows": float(count), "windows_real": float(len(real))}


class Measurement:
    """Metrics that windows are added to.

    Args:
        metrics: Name -> metric, of this measurement alone.
    """

    def __init__(self, metrics: Mapping[str, WindowMetric]) -> None:
        self._metrics = metrics

    def to(self, device: torch.device) -> Measurement:
        """The same on another device."""
        return Measurement({name: metric.to(device) for name, metric in self._metrics.items()})

    def stay_alone(self) -> None:
        """Ask no other process, of a distributed run, for what it has added."""
        for metric in self._metrics.values():
            metric.distributed_available_fn = _by_itself

    def update(self, generated: EvaluationWindows, real: EvaluationWindows) -> None:
        """Add windows of both sides.

        Raises:
            CospeechError: A metric fails; it is named.
        """
        for name, metric in self._metrics.items():
            with _named(name, metric):
                metric.update(generated, real)

    def compute(self) -> dict[str, Tensor]:
        """What the metrics have computed, by name; of several values ``NAME_PART``.

        Raises:
            CospeechError: A metric fails, gives no number, or one that another gives; it is named.
        """
        values = dict[str, Tensor]()
        for name, metric in self._metrics.items():
            with _named(name, metric):
                computed: Any = metric.compute()
                parts = computed if isinstance(computed, Mapping) else {VALUE: computed}
                for part, value in parts.items():
                    key = name if part == VALUE else f"{name}_{part}"
                    number = torch.as_tensor(value)
                    if number.numel() != 1:
                        raise ValueError(f"{key} has the shape {tuple(number.shape)}")
                    if key in values or key in RESERVED:
                        raise ValueError(f"{key} is another value's name")
                    if not number.isfinite().all():
                        logger.warning(
                            "the metric %s is %s: tables leave it out", key, number.item()
                        )
                    values[key] = number.reshape(())
        return values


def standard_catalogue() -> Catalogue:
    """The metrics of ``conf/metrics/default.yaml``, for an evaluation without a config."""
    return Catalogue(
        {
            "fgd": FrechetGestureDistance(),
            "kernel_distance": KernelDistance(),
            "feature_distance": FeatureDistance(),
            "joint_mae": JointMAE(),
            "acceleration_error": AccelerationError(),
            "acceleration": Acceleration(),
            "jerk": Jerk(),
        }
    )


def _by_itself() -> bool:
    return False


@contextmanager
def _named(name: str, metric: WindowMetric) -> Iterator[None]:
    try:
        yield
    except CospeechError:
        raise
    except Exception as error:
        reason = str(error).strip().split("\n", 1)[0] or type(error).__name__
        (*_, last) = traceback.extract_tb(error.__traceback__)
        raise CospeechError(
            f"the metric {name} ({type(metric).__name__}) fails in {last.filename}, line"
            f" {last.lineno}: {reason}",
            f"mend it, or do without: ~metrics.catalogue.{name}",
        ) from error
