"""The camera of still pictures and video: joints in metres to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.motion import Motion
from cospeech.reporting.framing import Extent, facing

_FIELD_OF_VIEW = math.radians(30)
_AZIMUTH = 0.42
_ELEVATION = 0.12
_FOLLOW_S = 2.0
# how far a shadow falls to the person's right and behind, per metre of height
_SHADOW_RIGHT, _SHADOW_BACK = 0.44, 0.75


def ground_path(motion: Motion) -> NDArray[np.float64]:
    """Where the root is on the ground, ``(T, 2)`` x and z in metres, averaged over ±2 s.

    The camera follows it: travel stays in the picture, steps and turns stay visible.
    """
    centre = motion.positions[:, 0, ::2].astype(np.float64)
    half = round(_FOLLOW_S * motion.fps)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(centre, axis=0)])
    frames = np.arange(len(motion))
    first, last = np.maximum(frames - half, 0), np.minimum(frames + half + 1, len(motion))
    return (sums[last] - sums[first]) / (last - first)[:, None]


@dataclass(frozen=True)
class Projection:
    """A point's place in the picture.

    Attributes:
        pixels: ``(..., 2)``, x right and y down.
        depth: ``(...,)`` metres in front of the camera.
        scale: ``(...,)`` pixels per metre there.
    """

    pixels: NDArray[np.float64]
    depth: NDArray[np.float64]
    scale: NDArray[np.float64]


class Camera:
    """Three-quarter view of one motion in one cell of the picture, following the body's travel.

    Args:
        motion: What is looked at; sets distance, height and heading.
        cell: Width and height in pixels.
        extent: Its floor and height.
        distance: Metres; None takes the least that shows the whole clip.
    """

    def __init__(
        self,
        motion: Motion,
        cell: tuple[int, int],
        extent: Extent,
        distance: float | None = None,
    ) -> None:
        self.cell = cell
        self.floor = extent.floor
        self.path = ground_path(motion)
        self._middle = extent.floor + 0.52 * extent.height
        around = motion.positions[:, :, ::2] - self.path[:, None]
        reach = float(np.linalg.norm(around, axis=-1).max())
        half = math.tan(_FIELD_OF_VIEW / 2)
        width_px, height_px = cell
        fitting = 0.5 * reach + max(
            0.55 * extent.height / half, 0.9 * reach / (half * width_px / height_px)
        )
        self.distance = fitting if distance is None else distance
        self._yaw = facing(motion)
        azimuth = _AZIMUTH + self._yaw
        level, rise = math.cos(_ELEVATION), math.sin(_ELEVATION)
        sine, cosine = math.sin(azimuth), math.cos(azimuth)
        self._axes = np.array(
            [
                [cosine, 0.0, -sine],
                [-sine * rise, level, -cosine * rise],
                [sine * level, rise, cosine * level],
            ]
        )
        self._focal = height_px / 2 / half
        self._middle_px = np.array([width_px / 2, height_px / 2])

    def project(self, points: NDArray[np.floating], frame: int) -> Projection:
        """Points ``(..., 3)``, metres, as the camera sees them at a frame of its motion."""
        target = np.array([self.path[frame, 0], self._middle, self.path[frame, 1]])
        seen = (np.asarray(points, dtype=np.float64) - target) @ self._axes.T
        depth = np.maximum(self.distance - seen[..., 2], 0.05)
        scale = self._focal / depth
        pixels = self._middle_px + seen[..., :2] * scale[..., None] * np.array([1.0, -1.0])
        return Projection(pixels, depth, scale)

    def shadows(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Where the shadows of points ``(..., 3)`` fall: the light is fixed to the person."""
        height = points[..., 1] - self.floor
        right, back = _SHADOW_RIGHT * height, _SHADOW_BACK * height
        sine, cosine = math.sin(self._yaw), math.cos(self._yaw)
        return np.stack(
            [
                points[..., 0] - right * cosine - back * sine,
                np.full(height.shape, self.floor),
                points[..., 2] + right * sine - back * cosine,
            ],
            axis=-1,
        )
