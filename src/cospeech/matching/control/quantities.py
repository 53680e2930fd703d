"""Named numbers of a pose or its movement that controls speak of.

The same definitions measure a database and generated motion, so a study judges by what it asked
for. Positions are in the body frame: metres from the pelvis, +x to the speaker's left, y up, +z the
way the speaker faces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError
from cospeech.suggestions import did_you_mean

Values = NDArray[np.float64]
_Measure = Callable[[Mapping[str, Values], float], Values]


@dataclass(frozen=True)
class Quantity:
    """A number of every frame.

    Attributes:
        name: What expressions call it.
        unit: ``m`` or ``m/s``.
        about: What it is, in a few words.
        roles: The joints it is taken from.
        compute: From ``(..., T, 3)`` positions by role, and frames per second.
    """

    name: str
    unit: str
    about: str
    roles: tuple[str, ...]
    compute: _Measure


def _coordinate(role: str, axis: int) -> _Measure:
    return lambda joints, fps: joints[role][..., axis]


def _speed(role: str) -> _Measure:
    def speed(joints: Mapping[str, Values], fps: float) -> Values:
        steps = np.linalg.norm(np.diff(joints[role], axis=-2), axis=-1) * fps
        if steps.shape[-1] == 0:
            return np.zeros(joints[role].shape[:-1])
        return np.concatenate([steps[..., :1], steps], axis=-1)

    return speed


def _radius(role: str) -> _Measure:
    return lambda joints, fps: np.hypot(joints[role][..., 0], joints[role][..., 2])


def _mean(first: _Measure, second: _Measure) -> _Measure:
    return lambda joints, fps: (first(joints, fps) + second(joints, fps)) / 2


def _asymmetry(joints: Mapping[str, Values], fps: float) -> Values:
    return np.abs(joints["left_wrist"][..., 1] - joints["right_wrist"][..., 1])


def _hands_distance(joints: Mapping[str, Values], fps: float) -> Values:
    return np.linalg.norm(joints["left_wrist"] - joints["right_wrist"], axis=-1)


_WRISTS = ("left_wrist", "right_wrist")


def _catalogue() -> dict[str, Quantity]:
    found: list[Quantity] = []

    def add(name: str, unit: str, about: str, roles: tuple[str, ...], compute: _Measure) -> None:
        found.append(Quantity(name, unit, about, roles, compute))

    for wrist in _WRISTS:
        add(f"{wrist}_height", "m", "height above the pelvis", (wrist,), _coordinate(wrist, 1))
    for wrist in _WRISTS:
        add(f"{wrist}_speed", "m/s", "speed seen from the pelvis", (wrist,), _speed(wrist))
    mean_speed = _mean(*(_speed(wrist) for wrist in _WRISTS))
    add("speed", "m/s", "mean speed of both wrists", _WRISTS, mean_speed)
    add("asymmetry", "m", "how much higher one wrist is than the other", _WRISTS, _asymmetry)
    for wrist in _WRISTS:
        about = "distance from the vertical through the pelvis"
        add(f"{wrist}_radius", "m", about, (wrist,), _radius(wrist))
    mean_radius = _mean(*(_radius(wrist) for wrist in _WRISTS))
    add("radius", "m", "mean radius of both wrists", _WRISTS, mean_radius)
    add("hands_distance", "m", "distance between the wrists", _WRISTS, _hands_distance)
    axes = ("to the speaker's left", "upwards (the height)", "forwards")
    for wrist in _WRISTS:
        for axis, about in enumerate(axes):
            name = f"{wrist}_{'xyz'[axis]}"
            add(name, "m", f"coordinate {about}", (wrist,), _coordinate(wrist, axis))
    for elbow in ("left_elbow", "right_elbow"):
        add(f"{elbow}_height", "m", "height above the pelvis", (elbow,), _coordinate(elbow, 1))
    return {quantity.name: quantity for quantity in found}


QUANTITIES: dict[str, Quantity] = _catalogue()
"""Every quantity by its name."""


def measure(name: str, positions: NDArray[np.floating], roles: Sequence[str], fps: float) -> Values:
    """One quantity of every frame.

    A speed is the Euclidean step from the frame before times ``fps``; the first frame has the
    second's, so nothing is read across the edge of a sequence (docs/facts/motion_matching.md,
    section 5).

    Args:
        name: Key of `QUANTITIES`.
        positions: ``(..., T, J, 3)`` in the body frame, metres.
        roles: What each of the J joints is.
        fps: Frames per second.

    Returns:
        ``(..., T)`` in the quantity's unit.

    Raises:
        ConfigError: There is no such quantity, or the motion lacks a joint of it.
    """
    if name not in QUANTITIES:
        raise ConfigError(
            f"there is no quantity {name!r}{did_you_mean(name, QUANTITIES)}",
            f"the quantities are {', '.join(QUANTITIES)}",
        )
    quantity = QUANTITIES[name]
    missing = [role for role in quantity.roles if role not in roles]
    if missing:
        raise ConfigError(
            f"{name} needs {', '.join(missing)}, and the motion has {', '.join(roles)}",
            "control another quantity, or use a corpus with these joints",
        )
    places = {role: list(roles).index(role) for role in quantity.roles}
    joints = {
        role: np.asarray(positions[..., place, :], dtype=np.float64)
        for role, place in places.items()
    }
    return quantity.compute(joints, fps)
