"""Leading principal coordinates of features, whose differences bound distances from below."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cospeech.matching.kernels import Bounds

_COORDINATES = {False: 56, True: 113}
"""Of poses and of audio, whose directions have no axes to spare."""

_PADDED_TO = 16  # starts, so that whole vector registers are worked on
_SEQUENCES_AT_ONCE = 512
_ROWS_FOR_AXES = 1 << 16
_LARGEST = 2**15 - 1

UNIT_ROUNDOFF = 2.0**-24


class LeadingCoordinates:
    """Rows turned to the axes that hold most of them; for `nearest_frames`.

    A rotation to the principal axes keeps distances, and the first few axes hold nearly all of one;
    the length of what the other axes hold is one more coordinate. Coordinates are 16-bit integers,
    each with a scale of its own.

    Args:
        rows: ``(M, T, D)`` features.
        lengths: ``(M, S)`` what rows are divided by: their lengths where directions are compared.
        usable: ``(M, S)`` starts that queries may use.
        is_audio: Whether directions are compared.
    """

    def __init__(
        self,
        rows: NDArray[np.float32],
        lengths: NDArray[np.float64],
        usable: NDArray[np.bool_],
        is_audio: bool,
    ) -> None:
        self._is_audio = is_audio
        (count, starts), width = lengths.shape, rows.shape[2]
        every = max(1, count * starts // _ROWS_FOR_AXES)
        sample = _scaled(rows[::every, :starts], lengths[::every]).reshape(-1, width)
        self._axes = np.linalg.eigh(sample.T @ sample)[1][:, ::-1].copy()
        self._kept = min(_COORDINATES[is_audio] - 1, width)
        # The kernel adds up coordinates in fours.
        height = -(-(self._kept + 1) // 4) * 4
        padded = -(-starts // _PADDED_TO) * _PADDED_TO
        self._longest = 0.0
        self._halves = np.full((count, padded), np.inf, dtype=np.float32)
        largest = np.zeros(height)
        blocks = [slice(i, i + _SEQUENCES_AT_ONCE) for i in range(0, count, _SEQUENCES_AT_ONCE)]
        for block in blocks:
            scaled = _scaled(rows[block, :starts], lengths[block])
            squares = self._squares(scaled)
            self._longest = max(self._longest, math.sqrt(float(squares.max())))
            self._halves[block, :starts] = np.where(usable[block], squares / 2, np.inf)
            turned = self._turned(scaled, height)
            largest = np.maximum(largest, np.abs(turned).max(axis=(0, 1)))
        self._scales = np.where(largest > 0, largest, 1) / _LARGEST
        self._coordinates = np.zeros((count, height, padded), dtype=np.int16)
        for block in blocks:
            turned = self._turned(_scaled(rows[block, :starts], lengths[block]), height)
            turned /= self._scales
            np.rint(turned, out=turned)
            self._coordinates[block, :, :starts] = turned.transpose(0, 2, 1)

    @property
    def padded_shape(self) -> tuple[int, int]:
        """(M, S'): starts of every sequence, padded."""
        count, padded = self._halves.shape
        return count, padded

    @property
    def nbytes(self) -> int:
        """What bounds of every row are read from."""
        return self._coordinates.nbytes + self._halves.nbytes

    def bounds(self, queries: NDArray[np.float64]) -> Bounds:
        """What bounds of the distances to ``(B, D)`` queries need.

        The slack covers

        * rounding of coordinates: half a unit of each, times the query's;
        * single precision: a sum of L products is off by at most ``L u |x| |q|``, in whatever order
          it is added up; numbers that are rounded and the few more that are added, among them
          bounds themselves, count as 32 more.
        """
        if self._is_audio:
            queries = _scaled(queries, np.sqrt((queries * queries).sum(axis=1)))
        height = len(self._scales)
        vectors = -self._turned(queries, height) * self._scales
        squares = self._squares(queries)
        rounding = np.abs(vectors).sum(axis=1) / 2
        slack = rounding + (height + 32) * UNIT_ROUNDOFF * (np.sqrt(squares) + self._longest) ** 2
        return Bounds(
            self._coordinates,
            self._halves,
            vectors.astype(np.float32),
            (squares / 2).astype(np.float32),
            np.nextafter(slack.astype(np.float32), np.float32(np.inf)),
            self._kept,
        )

    def _squares(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared lengths; 1 for all audio, so that without a direction the cosine counts as 0."""
        if self._is_audio:
            return np.ones(values.shape[:-1])
        squares: NDArray[np.float64] = (values * values).sum(axis=-1)
        return squares

    def _turned(self, values: NDArray[np.float64], height: int) -> NDArray[np.float64]:
        """Leading coordinates on the last axis, the length of what is left, and zeros."""
        turned = values @ self._axes
        result = np.zeros((*values.shape[:-1], height))
        result[..., : self._kept] = turned[..., : self._kept]
        result[..., self._kept] = np.sqrt((turned[..., self._kept :] ** 2).sum(axis=-1))
        return result


def row_lengths(rows: NDArray[np.float32], starts: int) -> NDArray[np.float64]:
    """``(M, S)`` lengths of the rows, as `audio_distances` computes them."""
    lengths = np.empty((len(rows), starts))
    for first in range(0, len(rows), _SEQUENCES_AT_ONCE):
        values = rows[first : first + _SEQUENCES_AT_ONCE, :starts].astype(np.float64)
        lengths[first : first + len(values)] = np.sqrt((values * values).sum(axis=2))
    return lengths


def _scaled(rows: NDArray[np.floating], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows over lengths; 0 where the length is 0."""
    values = rows.astype(np.float64)
    by = lengths[..., None]
    return np.divide(values, by, out=np.zeros_like(values), where=by > 0)
