"""Motion that is not a number, jumps, or changes sides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.body import LEFT_ARM, RIGHT_ARM, Body
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.motion.motion import Motion

FASTEST_M_PER_S = 15.0
"""No hand of a talking person moves faster relative to the body; recorded gestures reach 11."""

FASTEST_ROOT_M_PER_S = 10.0
"""Nobody runs faster through a room."""

LONELY_M_PER_S, LONELY_RATIO, LONELY_REACH = 5.0, 5.0, 3
"""From this speed on, a step that is so many times the median of the steps up to three frames away
is a jump: at 15 fps a hand can be thrown 0.3 m off without being too fast for a human. The fastest
gestures recorded reach 4 times."""

SWAP_M, SWAP_SHARE = 0.3, 0.25
"""Left and right are exchanged between two frames when elbows and wrists move by more than the
first in sum, m, and by less than the second of that if they are exchanged back."""

SHOULDERS_M = 0.36
"""Distance of an adult's shoulders, m: the scale of a picture."""

_MENTIONED = 5


def check_finite(motion: Motion, files: Files) -> Iterator[Finding]:
    """NaN or infinite coordinates."""
    bad = motion.first_bad_frame()
    if bad is None:
        return
    wrong = np.any(~np.isfinite(motion.positions), axis=2)
    joint = motion.skeleton.joints[int(wrong[bad].argmax())]
    yield Finding(
        Check.NOT_A_NUMBER,
        Severity.ERROR,
        files.motion,
        f"{int(wrong.any(axis=1).sum())} frames hold NaN or infinity, first frame {bad} at"
        f" joint {joint}",
        "fill the gap in the capture software, or cut the recording there",
        time_s=bad / motion.fps,
    )


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


def check_swaps(motion: Motion, swaps: NDArray[np.int64], files: Files) -> Iterator[Finding]:
    """Left and right arms that change places in the middle; see `find_swaps`."""
    if len(swaps) == 0:
        return
    times = ", ".join(f"{frame / motion.fps:.2f}" for frame in swaps[:_MENTIONED])
    times += f" and {len(swaps) - _MENTIONED} more times" if len(swaps) > _MENTIONED else ""
    yield Finding(
        Check.SIDES,
        Severity.ERROR,
        files.motion,
        f"the left and right arm change places between two frames, at {times} s",
        "exchange the two arms' joints back in every other stretch between these times",
        time_s=float(swaps[0] / motion.fps),
    )


def check_jumps(
    motion: Motion, body: Body | None, explained: NDArray[np.int64], files: Files
) -> Iterator[Finding]:
    """Joints that are elsewhere in the next frame.

    Looked at relative to the root, so that the whole recording is not one big jump when the body
    is moved; the root has its own limit. The joint named is the highest of those that jump.

    Args:
        motion: Finite.
        body: Its upper body; gives the size.
        explained: Frames that may be far from the one before them: arms change places, or a body
            moves on after a standstill.
        files: What to call them.
    """
    scale = _units_per_metre(motion, body)
    if len(motion) < 3 or scale is None:
        return
    root = motion.skeleton.parents.index(-1)
    own = motion.positions - motion.positions[:, root : root + 1]
    own[:, root] = motion.positions[:, root]
    speed = np.linalg.norm(np.diff(own, axis=0), axis=-1) * (motion.fps / scale)
    speed[explained - 1] = 0.0
    limit = np.full(len(motion.skeleton), FASTEST_M_PER_S)
    limit[root] = FASTEST_ROOT_M_PER_S
    too_fast = speed > limit
    lonely = _lonely(speed) & ~too_fast.any(axis=1, keepdims=True)
    for jumps, severity in ((too_fast, Severity.ERROR), (lonely, Severity.WARNING)):
        if not jumps.any():
            continue
        # Where the size is a guess, so is the speed.
        severity = severity if body is not None else Severity.WARNING
        frames = np.flatnonzero(jumps.any(axis=1))
        worst = int(frames[(speed * jumps)[frames].max(axis=1).argmax()])
        joint = int(jumps[worst].argmax())
        others = len(frames) - 1
        yield Finding(
            Check.JUMP,
            severity,
            files.motion,
            f"{motion.skeleton.joints[joint]} jumps by"
            f" {speed[worst, joint] / motion.fps:.2f} m in one frame"
            f" ({speed[worst, joint]:.1f} m/s)"
            + (f"; {others} more jumps, the first at" if others else "")
            + (f" {(frames[0] + 1) / motion.fps:.2f} s" if others else ""),
            "mend these frames in the capture software (a marker was lost or exchanged there),"
            " or cut the stretch out",
            time_s=(worst + 1) / motion.fps,
        )


def _units_per_metre(motion: Motion, body: Body | None) -> float | None:
    """Size of a metre in the motion; None where it can't be known."""
    if body is not None:
        return body.scale
    if motion.dimensions == 3:
        return 1.0
    names = ("left_shoulder", "right_shoulder")
    if any(name not in motion.skeleton.index for name in names):
        return None
    places = motion.positions[:, [motion.skeleton.index[name] for name in names]]
    width = float(np.median(np.linalg.norm(places[:, 0] - places[:, 1], axis=-1)))
    return width / SHOULDERS_M if width > 0 else None


def _lonely(speed: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Fast steps among slow ones."""
    lonely = np.zeros(speed.shape, np.bool_)
    for frame, joint in zip(*np.nonzero(speed > LONELY_M_PER_S), strict=True):
        around = speed[max(0, frame - LONELY_REACH) : frame + LONELY_REACH + 1, joint]
        lonely[frame, joint] = speed[frame, joint] > LONELY_RATIO * np.median(around)
    return lonely
