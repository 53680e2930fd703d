"""Motion that stands still, jumps, or changes sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.body import LEFT_ARM, RIGHT_ARM, Body
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

FASTEST_M_PER_S = 15.0
"""No hand of a talking person moves faster relative to the body; recorded gestures reach 11."""

FASTEST_ROOT_M_PER_S = 10.0
"""Nobody runs faster through a room."""

LONELY_M_PER_S, LONELY_RATIO = 5.0, 8.0
"""A step that is that many times the median of the steps around it is a jump from this speed on:
at 15 fps a hand can be thrown 0.3 m off without being too fast for a human."""

AROUND_S = 0.25
"""How far around a step its neighbours are looked at, s."""

SWAP_M, SWAP_SHARE = 0.3, 0.25
"""Left and right are exchanged between two frames when elbows and wrists move by more than the
first in sum, m, and by less than the second of that if they are exchanged back."""

_MENTIONED = 5


def check_finite(motion: Motion, files: Files) -> list[Finding]:
    """NaN or infinite coordinates."""
    bad = motion.first_bad_frame()
    if bad is None:
        return []
    wrong = ~np.isfinite(motion.positions).all(axis=2)
    joint = motion.skeleton.joints[int(wrong[bad].argmax())]
    return [
        Finding(
            Check.NOT_A_NUMBER,
            Severity.ERROR,
            files.motion,
            bad / motion.fps,
            f"{int(wrong.any(axis=1).sum())} frames hold NaN or infinity, first frame {bad} at"
            f" joint {joint}",
            "fill the gap in the capture software, or cut the recording there",
        )
    ]


def check_frozen(motion: Motion, body: Body | None, files: Files) -> list[Finding]:
    """A body, an arm or a head that does not move at all for a while.

    Args:
        motion: Finite.
        body: Its upper body, where it has one.
        files: What to call them.
    """
    if len(motion) < 2:
        return []
    still = STILL_PX if motion.dimensions == 2 else STILL_M * (1.0 if body is None else body.scale)
    moves = (np.abs(np.diff(motion.positions, axis=0)) > still).any(axis=(1, 2))
    findings = []
    frozen = long_stretches(~moves, FROZEN_BODY_S * motion.fps)
    if len(frozen):
        longest = float((frozen[:, 1] - frozen[:, 0]).max() / motion.fps)
        start, stop = frozen[(frozen[:, 1] - frozen[:, 0]).argmax()] / motion.fps
        more = f", the longest of {len(frozen)} such stretches" if len(frozen) > 1 else ""
        findings.append(
            Finding(
                Check.FROZEN,
                Severity.ERROR if longest >= LONG_FROZEN_BODY_S else Severity.WARNING,
                files.motion,
                float(start),
                f"no joint moves from {start:.2f} to {stop:.2f} s{more}",
                "the capture was lost there: cut the stretch out, or leave the recording out",
            )
        )
    if body is not None:
        findings += _frozen_limbs(motion, body, moves, still, files)
    return findings


def _frozen_limbs(
    motion: Motion, body: Body, moves: NDArray[np.bool_], still: float, files: Files
) -> list[Finding]:
    groups = (("the head", (3,)), ("the left arm", (5, 6)), ("the right arm", (8, 9)))
    findings = []
    for limb, points in groups:
        for point in points:
            frozen = _frozen_point(motion, body, point, still) & moves
            # Frames in which nothing moves join the stretch around them.
            runs = long_stretches(frozen | ~moves, FROZEN_JOINT_S * motion.fps)
            runs = [run for run in runs if frozen[run[0] : run[1]].mean() > 0.5]
            if not runs:
                continue
            start, stop = max(runs, key=lambda run: run[1] - run[0]) / motion.fps
            whole = stop - start > 0.98 * motion.duration
            # Some captures have no head sensor: the joint is there and never turns.
            severity = Severity.WARNING if limb == "the head" or whole else Severity.ERROR
            findings.append(
                Finding(
                    Check.FROZEN,
                    severity,
                    files.motion,
                    float(start),
                    f"{limb} ({body.names[point]}) does not move"
                    + (" in the whole recording" if whole else f" from {start:.2f} to {stop:.2f} s")
                    + ", while the rest does",
                    "the joint was not captured: leave it out of what is judged, or the recording"
                    if whole
                    else "its tracking was lost there: cut the stretch out, or leave the recording"
                    " out",
                )
            )
            break
    return findings


def _frozen_point(
    motion: Motion, body: Body, point: int, still: float
) -> NDArray[np.bool_]:
    """Per step, whether a point of a limb stays in the room, on its parent, or in its rotation."""
    parent = {3: 1, 5: 4, 6: 5, 8: 7, 9: 8}[point]
    place = body.points[:, point]
    frozen = (np.abs(np.diff(place, axis=0)) < still).all(axis=1)
    frozen |= (np.abs(np.diff(place - body.points[:, parent], axis=0)) < still).all(axis=1)
    # The elbow is moved by the rotation of the shoulder's joint, the wrist by the elbow's.
    turning = body.joints[point if point == 3 else parent]
    if motion.rotations_local is not None and turning is not None:
        steps = np.abs(np.diff(motion.rotations_local[:, turning], axis=0))
        frozen |= (steps < STILL_TURN).all(axis=1)
    return frozen


def find_swaps(motion: Motion, body: Body) -> NDArray[np.int64]:
    """Frames at which the left and right arm change places.

    Args:
        motion: Finite.
        body: Its upper body.

    Returns:
        ``(S,)`` first frames after each exchange.
    """
    points = (body.points - body.points[:, :1]) / body.scale
    left, right = points[:, LEFT_ARM[1:]], points[:, RIGHT_ARM[1:]]

    def distance(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.linalg.norm(after[1:] - before[:-1], axis=-1).sum(axis=1)

    same = distance(left, left) + distance(right, right)
    crossed = distance(left, right) + distance(right, left)
    return np.flatnonzero((same > SWAP_M) & (crossed < SWAP_SHARE * same)) + 1


def check_swaps(motion: Motion, swaps: NDArray[np.int64], files: Files) -> list[Finding]:
    """Left and right arms that change places in the middle; see `find_swaps`."""
    if len(swaps) == 0:
        return []
    times = ", ".join(f"{frame / motion.fps:.2f}" for frame in swaps[:_MENTIONED])
    times += f" and {len(swaps) - _MENTIONED} more times" if len(swaps) > _MENTIONED else ""
    return [
        Finding(
            Check.SIDES,
            Severity.ERROR,
            files.motion,
            float(swaps[0] / motion.fps),
            f"the left and right arm change places between two frames, at {times} s",
            "exchange the two arms' joints back in every other stretch between these times",
        )
    ]


def check_jumps(
    motion: Motion, body: Body | None, swaps: NDArray[np.int64], files: Files
) -> list[Finding]:
    """Joints that are elsewhere in the next frame.

    Looked at relative to the root, so that the whole recording is not one big jump when the body
    is moved; the root has its own limit. The joint named is the highest of those that jump.

    Args:
        motion: Finite, three-dimensional.
        body: Its upper body; gives the size.
        swaps: Frames that `find_swaps` explains.
        files: What to call them.
    """
    if len(motion) < 3 or motion.dimensions != 3:
        return []
    scale = 1.0 if body is None else body.scale
    root = motion.skeleton.parents.index(-1)
    own = motion.positions - motion.positions[:, root : root + 1]
    own[:, root] = motion.positions[:, root]
    speed = np.linalg.norm(np.diff(own, axis=0), axis=-1) * (motion.fps / scale)
    if len(swaps):
        speed[swaps - 1] = 0.0
    limit = np.full(len(motion.skeleton), FASTEST_M_PER_S)
    limit[root] = FASTEST_ROOT_M_PER_S
    too_fast = speed > limit
    lonely = _lonely(speed, motion.fps) & ~too_fast.any(axis=1, keepdims=True)
    findings = []
    for jumps, severity in ((too_fast, Severity.ERROR), (lonely, Severity.WARNING)):
        if not jumps.any():
            continue
        frames = np.flatnonzero(jumps.any(axis=1))
        worst = int(frames[(speed * jumps)[frames].max(axis=1).argmax()])
        joint = int(jumps[worst].argmax())
        others = len(frames) - 1
        findings.append(
            Finding(
                Check.JUMP,
                severity,
                files.motion,
                (worst + 1) / motion.fps,
                f"{motion.skeleton.joints[joint]} jumps by"
                f" {speed[worst, joint] / motion.fps:.2f} m in one frame"
                f" ({speed[worst, joint]:.1f} m/s)"
                + (f"; {others} more jumps, the first at" if others else "")
                + (f" {(frames[0] + 1) / motion.fps:.2f} s" if others else ""),
                "mend these frames in the capture software (a marker was lost or exchanged there),"
                " or cut the stretch out",
            )
        )
    return findings


def _lonely(speed: NDArray[np.floating], fps: float) -> NDArray[np.bool_]:
    """Fast steps among slow ones."""
    fast = speed > LONELY_M_PER_S
    reach = max(3, round(AROUND_S * fps))
    lonely = np.zeros_like(fast)
    for frame, joint in zip(*np.nonzero(fast), strict=True):
        around = speed[max(0, frame - reach) : frame + reach + 1, joint]
        lonely[frame, joint] = speed[frame, joint] > LONELY_RATIO * np.median(around)
    return lonely
