"""How well classes were told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class PhaseScores:
    """Scores of a confusion matrix.

    Attributes:
        confusion: ``(K, K)`` counts; rows are true classes, columns found ones.
        f: ``(K,)`` F-score of each class; 0 for one that is neither there nor found.
        weighted_f: Their mean, weighted by the true classes' shares (the paper's "weighted").
        macro_f: Their plain mean over the classes that are there.
        accuracy: Share of steps that were told right.
        majority: Accuracy of always saying the class that is most frequent here.
        majority_weighted_f: Weighted F of the same.
    """

    confusion: NDArray[np.int64]
    f: NDArray[np.float64]
    weighted_f: float
    macro_f: float
    accuracy: float
    majority: float
    majority_weighted_f: float

    @classmethod
    def of(cls, confusion: ArrayLike) -> PhaseScores:
        """Scores of ``(K, K)`` counts, true classes in rows.

        Raises:
            ValueError: There are no counts.
        """
        counts = np.asarray(confusion, dtype=np.int64)
        there, found, right = counts.sum(1), counts.sum(0), counts.diagonal()
        total = int(counts.sum())
        if not total:
            raise ValueError("no step was classified")
        f = 2 * right / np.maximum(there + found, 1)
        shares = there / total
        largest = float(shares.max())
        return cls(
            confusion=counts,
            f=f,
            weighted_f=float(f @ shares),
            macro_f=float(f[there > 0].mean()),
            accuracy=float(right.sum() / total),
            majority=largest,
            majority_weighted_f=largest * 2 * largest / (1 + largest),
        )

    def table(self, classes: Sequence[str]) -> str:
        """Scores and the confusion matrix as text; shares of each true class in percent."""
        width = max(map(len, classes))
        lines = [
            f"weighted F {self.weighted_f:.3f}, macro F {self.macro_f:.3f},"
            f" accuracy {self.accuracy:.3f}; most frequent class: accuracy {self.majority:.3f},"
            f" weighted F {self.majority_weighted_f:.3f}",
            f"{'':{width}}      F   share  found as " + " ".join(f"{name:>11}" for name in classes),
        ]
        there = self.confusion.sum(1)
        for i, name in enumerate(classes):
            percent = 100 * self.confusion[i] / max(1, there[i])
            lines.append(
                f"{name:{width}}  {self.f[i]:.3f}  {100 * there[i] / there.sum():4.1f} %"
                f"           " + " ".join(f"{value:9.1f} %" for value in percent)
            )
        return "\n".join(lines)


def confusion_of(
    true: NDArray[np.integer], found: NDArray[np.integer], classes: int
) -> NDArray[np.int64]:
    """Counts ``(classes, classes)`` of (true, found) pairs."""
    pairs = np.bincount(true.ravel() * classes + found.ravel(), minlength=classes**2)
    return pairs.reshape(classes, classes).astype(np.int64)
