"""What validation says of a generator besides FGD: wrist velocity and phases.

See docs/facts/multi_adversary.md, section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, distributed

from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.metrics.movement import area_between, median_curve, wrist_velocities


class Tally:
    """Sums over the windows of one evaluation, generated beside real.

    Args:
        wrists: Indices of both wrists.
        fps: Steps per second.
        classifier: Tells the phases; None where nothing does.
    """

    def __init__(
        self, wrists: Sequence[int], fps: float, classifier: FrozenPhaseClassifier | None
    ) -> None:
        self.wrists, self.fps, self.classifier = list(wrists), fps, classifier
        self.classes = () if classifier is None else classifier.classes
        self._velocities: dict[str, list[np.ndarray]] = {"generated": [], "real": []}
        self._steps = {name: torch.zeros(len(self.classes)) for name in self._velocities}
        self._right, self._labelled = 0, 0

    def add(self, source: str, joints: Tensor, phases: Tensor | None) -> None:
        """Add windows.

        Args:
            source: ``"generated"`` or ``"real"``.
            joints: ``(B, T, J, 3)`` metres.
            phases: ``(B, T - 1, K)`` class probabilities; None without classes.
        """
        positions = joints.detach().cpu().numpy()
        self._velocities[source].append(wrist_velocities(positions, self.wrists, self.fps))
        if phases is not None:
            found = phases.argmax(dim=-1).flatten().cpu()
            self._steps[source] += torch.bincount(found, minlength=len(self.classes))

    def add_labels(self, phases: Tensor, labels: Tensor) -> None:
        """Compare ``(..., K)`` probabilities of real motion with annotated classes ``(...)``."""
        self._right += int((phases.argmax(dim=-1) == labels).sum())
        self._labelled += labels.numel()

    def gather(self) -> None:
        """Take the counts of all processes together; a median of shards isn't that of the whole."""
        if not (distributed.is_available() and distributed.is_initialized()):
            return
        counted = (self._velocities, self._steps, self._right, self._labelled)
        parts: list[Any] = [None] * distributed.get_world_size()
        distributed.all_gather_object(parts, counted)
        velocities, steps, right, labelled = zip(*parts, strict=True)
        for source in self._velocities:
            self._velocities[source] = [found for part in velocities for found in part[source]]
            self._steps[source] = torch.stack([part[source] for part in steps]).sum(dim=0)
        self._right, self._labelled = sum(right), sum(labelled)

    def gap(self) -> float:
        """Area between the median wrist velocities of both over time, metres per window."""
        curves = [median_curve(np.concatenate(found)) for found in self._velocities.values()]
        return float(area_between(curves[0], curves[1], self.fps))

    def values(self) -> dict[str, float]:
        """Everything that was counted, by the end of its logged name."""
        found = {"wrist_speed_gap": self.gap()}
        for source, steps in self._steps.items():
            for name, count in zip(self.classes, steps.tolist(), strict=True):
                found[f"phase_share_{name}_{source}"] = count / max(1.0, float(steps.sum()))
        if self._labelled:
            found["classifier_accuracy"] = self._right / self._labelled
        return found
