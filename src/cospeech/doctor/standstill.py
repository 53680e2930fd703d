"""Bodies, arms and heads that stand still while they should move."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.body import Body
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.stretches import long_stretches
from cospeech.motion.motion import Motion

STILL_M = 2e-5
"""Step of a joint between two frames below which it does not move, m. Recorded people who rest
never stayed below it for more than 0.1 s."""

STILL_TURN = 2e-6
"""The same for the components of a joint's local rotation."""

STILL_PX = 1e-3
"""The same for keypoints of a picture, pixels."""

FROZEN_BODY_S, LONG_FROZEN_BODY_S = 0.5, 2.0
"""A whole body that does not move at all for so long lost its capture; the second is an error."""

FROZEN_JOINT_S = 3.0
"""An arm or head that does not move at all for so long while other joints do, s."""

WHOLE = 0.98
"""Share of a recording that is all of it."""

BODY, HEAD = "the body", "the head"
_LIMBS = ((HEAD, (3,)), ("the left arm", (5, 6)), ("the right arm", (8, 9)))
_PARENTS = {3: 1, 5: 4, 6: 5, 8: 7, 9: 8}


@dataclass(frozen=True)
class Standstill:
    """A stretch in which something does not move.

    Attributes:
        what: `BODY`, `HEAD` or an arm.
        joint: The joint that stands still; empty for the body.
        start: First frame.
        stop: Frame after the last; it moves again from the one before it to this.
    """

    what: str
    joint: str
    start: int
    stop: int


def find_standstills(motion: Motion, body: Body | None) -> list[Standstill]:
    """Every stretch that is long enough to be a fault.

    Args:
        motion: Finite.
        body: Its upper body; without one, only all joints together are looked at.
    """
    if len(motion) < 2:
        return []
    still = STILL_PX if motion.dimensions == 2 else STILL_M * (1.0 if body is None else body.scale)
    moves = np.any(np.abs(np.diff(motion.positions, axis=0)) > still, axis=(1, 2))
    found = [
        Standstill(BODY, "", int(start), int(stop) + 1)
        for start, stop in long_stretches(~moves, FROZEN_BODY_S * motion.fps)
    ]
    if body is None:
        return found
    for limb, points in _LIMBS:
        for point in points:
            frozen = _stands_still(motion, body, point, still) & moves
            # Frames in which nothing moves join the stretch around them.
            runs = long_stretches(frozen | ~moves, FROZEN_JOINT_S * motion.fps)
            own = [run for run in runs if frozen[run[0] : run[1]].mean() > 0.5]
            found += [Standstill(limb, body.names[point], int(a), int(b) + 1) for a, b in own]
            if own:
                break
    return found


def check_standstills(
    motion: Motion, standstills: Iterable[Standstill], files: Files
) -> list[Finding]:
    """One finding for the body and for each limb that stands still, with its longest stretch."""
    by_what: dict[str, list[Standstill]] = {}
    for standstill in standstills:
        by_what.setdefault(standstill.what, []).append(standstill)
    return [_finding(motion, what, found, files) for what, found in by_what.items()]


def _finding(motion: Motion, what: str, found: list[Standstill], files: Files) -> Finding:
    longest = max(found, key=lambda one: one.stop - one.start)
    start_s, stop_s = longest.start / motion.fps, (longest.stop - 1) / motion.fps
    when = f"from {start_s:.2f} to {stop_s:.2f} s"
    if len(found) > 1:
        when += f" (the longest of {len(found)} stretches)"
    lost = "cut the stretch out, or leave the recording out"
    if what == BODY:
        is_long = stop_s - start_s >= LONG_FROZEN_BODY_S
        return Finding(
            Check.FROZEN,
            Severity.ERROR if is_long else Severity.WARNING,
            files.motion,
            f"no joint moves {when}",
            f"the capture was lost there: {lost}",
            time_s=start_s,
        )
    whole = stop_s - start_s > WHOLE * motion.duration
    severity = Severity.WARNING if what == HEAD or whole else Severity.ERROR
    return Finding(
        Check.FROZEN,
        # Some captures have no head sensor: the joint is there and never turns.
        Severity.NOTE if what == HEAD and whole else severity,
        files.motion,
        f"{what} ({longest.joint}) does not move {'in the whole recording' if whole else when},"
        " while the rest does",
        "the joint was not captured: leave it out of what is judged, or the recording out"
        if whole
        else f"its tracking was lost there: {lost}",
        time_s=start_s,
    )


def _stands_still(motion: Motion, body: Body, point: int, still: float) -> NDArray[np.bool_]:
    """Per step, whether a point of a limb stays in the room, on its parent, or in its rotation."""
    parent = _PARENTS[point]
    place = body.points[:, point]
    frozen = np.all(np.abs(np.diff(place, axis=0)) < still, axis=1)
    frozen |= np.all(np.abs(np.diff(place - body.points[:, parent], axis=0)) < still, axis=1)
    turning = _turned_by(motion, body, point)
    if motion.rotations_local is not None and turning is not None:
        steps = np.abs(np.diff(motion.rotations_local[:, turning], axis=0))
        frozen |= np.all(steps < STILL_TURN, axis=1)
    return frozen


def _turned_by(motion: Motion, body: Body, point: int) -> int | None:
    """Joint whose rotation moves a point on its parent."""
    if point in (5, 6, 8, 9):
        # The elbow is moved by the rotation of the shoulder's joint, the wrist by the elbow's.
        return body.joints[_PARENTS[point]]
    joint = body.joints[point]
    if joint is None or not body.own[point]:
        return joint  # a point with an offset turns with its own joint
    above = motion.skeleton.parents[joint]
    return above if above >= 0 else None
