"""A confusion matrix as a picture."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from lightning.fabric.loggers.logger import Logger
from numpy.typing import NDArray

from cospeech.files import write_text

_CELL, _LEFT, _TOP = 76, 118, 54
_PALE, _DARK = np.array([247, 249, 252]), np.array([31, 94, 168])


def write_confusion(
    path: Path, confusion: NDArray[np.int64], classes: Sequence[str], title: str
) -> None:
    """Write `confusion_svg`; the file appears only when complete."""
    write_text(path, confusion_svg(confusion, classes, title))


def show_confusion(
    loggers: Iterable[Logger], name: str, confusion: NDArray[np.int64], epoch: int
) -> None:
    """Show the matrix in every logger that takes pictures."""
    pixels = confusion_pixels(confusion)
    for logger in loggers:
        if hasattr(logger, "log_image"):  # Weights & Biases
            logger.log_image(name, [pixels])
            continue
        show = getattr(getattr(logger, "experiment", None), "add_image", None)
        if show is not None and find_spec("PIL"):  # TensorBoard, which needs Pillow for it
            show(name, pixels, epoch, dataformats="HWC")


def confusion_svg(confusion: NDArray[np.int64], classes: Sequence[str], title: str) -> str:
    """An SVG file: rows are true classes, columns found ones, numbers percent of the row.

    Args:
        confusion: ``(K, K)`` counts.
        classes: K names.
        title: Above it.
    """
    size = len(classes) * _CELL
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_LEFT + size + 12}"'
        f' height="{_TOP + size + 12}" font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        f'<text x="8" y="18" font-size="13">{html.escape(title)}</text>',
    ]
    for i, name in enumerate(classes):
        centre = (i + 0.5) * _CELL
        label = html.escape(name.replace("_", " "))
        parts.append(
            f'<text x="{_LEFT + centre}" y="{_TOP - 8}" text-anchor="middle">{label}</text>'
            f'<text x="{_LEFT - 8}" y="{_TOP + centre + 4}" text-anchor="end">{label}</text>'
        )
    for (row, column), share in np.ndenumerate(_row_shares(confusion)):
        x, y = _LEFT + column * _CELL, _TOP + row * _CELL
        ink = "#ffffff" if share > 0.55 else "#1c2430"
        parts.append(
            f'<rect x="{x}" y="{y}" width="{_CELL}" height="{_CELL}" stroke="#ffffff"'
            f' fill="rgb({",".join(map(str, _colour(share)))})"><title>'
            f"{int(confusion[row, column])} steps</title></rect>"
            f'<text x="{x + _CELL / 2}" y="{y + _CELL / 2 + 4}" text-anchor="middle"'
            f' fill="{ink}">{100 * share:.0f} %</text>'
        )
    return "\n".join([*parts, "</svg>", ""])


def confusion_pixels(confusion: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The matrix alone as an RGB picture ``(H, W, 3)``, for loggers that show pictures."""
    cells = np.array([[_colour(share) for share in row] for row in _row_shares(confusion)])
    return cells.astype(np.uint8).repeat(32, axis=0).repeat(32, axis=1)


def _row_shares(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    shares: NDArray[np.float64] = confusion / np.maximum(confusion.sum(1, keepdims=True), 1)
    return shares


def _colour(share: float) -> tuple[int, ...]:
    return tuple(int(value) for value in np.rint(_PALE + (_DARK - _PALE) * share))
