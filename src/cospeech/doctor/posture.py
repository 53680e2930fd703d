"""Wrong axes, units and sides: what the average pose gives away."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.body import HEAD, LEFT_ARM, NECK, NOSE, RIGHT_ARM, SPINE, Body
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import to_upper_body

UPRIGHT = 0.7
"""Share of the mean direction from spine to head that must point up: people lean 30 degrees while
they sit, hardly 45 on average."""

HUMAN_SCALE = (0.55, 1.6)
"""Arms and shoulders against an average adult's: small children to more than the tallest."""

UNIT_FACTORS: tuple[tuple[float, str], ...] = (
    (100.0, "metres read as centimetres"),
    (0.01, "centimetres read as metres"),
    (10.0, "centimetres read as millimetres"),
    (0.1, "millimetres read as centimetres"),
    (0.001, "millimetres read as metres"),
    (1000.0, "metres read as millimetres"),
    (0.0254, "inches read as metres"),
    (2.54, "inches read as centimetres"),
    (0.3048, "feet read as metres"),
    (30.48, "feet read as centimetres"),
    (5.64444, "CMU's units read as centimetres"),
)
"""Factors that make a wrongly read body human, and what each means."""

BACKWARD_BEND = -0.3
"""Mean forward share of the elbows' bend below which they bend the wrong way. Measured on people:
+0.5 to +0.95, and +0.2 for the lowest single arm."""

BENT = 0.15
"""Mean bend of the forearm, as the sine of its angle to the upper arm, below which hanging arms say
nothing (9 degrees)."""

FORWARD_NOSE_M = 0.02
"""Mean distance of the nose before or behind the line from neck to head that says something, m."""

UPSIDE_DOWN = 0.3
"""Mean height of the elbows over the shoulders, in shoulder widths, of a picture upside down."""

NOSE_FRAMES = 200
"""Frames that are enough for the mean place of the nose."""


def check_units(body: Body, files: Files) -> Iterator[Finding]:
    """Whether the body has human size."""
    low, high = HUMAN_SCALE
    if low < body.scale < high:
        return
    if body.scale < 1e-9:
        yield Finding(
            Check.UNITS,
            Severity.ERROR,
            files.motion,
            "shoulders, elbows and wrists are all at one point",
            "the joints' offsets are missing: check the header of the file",
        )
        return
    errors = [abs(np.log(body.scale * factor)) for factor, _ in UNIT_FACTORS]
    best = int(np.argmin(errors))
    factor, meaning = UNIT_FACTORS[best]
    upper_arm = body.scale * 0.29
    problem = f"the upper arm is about {upper_arm:.3g} m long, a person's is about 0.3 m"
    if low < body.scale * factor < high:
        problem += f": {meaning}"
        step = (
            f"multiply the unit scale by {factor:g} (data.unit_scale={0.01 * factor:g} where it was"
            " 0.01)"
        )
    else:
        step = f"multiply data.unit_scale by {1 / body.scale:.3g}; no usual unit fits"
    yield Finding(Check.UNITS, Severity.ERROR, files.motion, problem, step)


def check_vertical(body: Body, files: Files) -> Iterator[Finding]:
    """Whether +y is up."""
    up = body.points[:, HEAD] - body.points[:, SPINE]
    length = np.linalg.norm(up, axis=-1, keepdims=True)
    mean = (up / np.maximum(length, 1e-9)).mean(axis=0)
    if mean[1] >= UPRIGHT:
        return
    axis = int(np.abs(mean).argmax())
    name = ("+" if mean[axis] > 0 else "-") + "xyz"[axis]
    if abs(mean[axis]) < UPRIGHT:
        yield Finding(
            Check.VERTICAL,
            Severity.WARNING,
            files.motion,
            f"the head is not above the spine: on average it is towards {np.round(mean, 2)}",
            "is the person lying or bowing? If not, turn the data so that y is up",
        )
        return
    steps = {
        "-y": "y points down: turn the sign of y and of one more axis (keep left and right)",
        "+z": "z is up: data.up_axis=z, or export with y up, or turn by -90 degrees about x:"
        " (x, y, z) to (x, z, -y)",
    }
    yield Finding(
        Check.VERTICAL,
        Severity.ERROR,
        files.motion,
        f"the head is towards {name} of the spine, so {name} is up and not +y",
        steps.get(name, f"turn the data so that {name} becomes +y"),
    )


def check_sides(body: Body, motion: Motion, files: Files) -> Iterator[Finding]:
    """Whether left is left, by the way the elbows bend.

    The names of the shoulders and the line from spine to neck say where the front is; hands bend
    towards the front. If they bend backwards, left and right are exchanged or the data is mirrored,
    whatever way the body is turned. The nose, where there is one, is heard too.

    Args:
        body: An upright body.
        motion: What it was found in.
        files: What to call them.
    """
    shoulders = body.points[:, LEFT_ARM[0]] - body.points[:, RIGHT_ARM[0]]
    if body.hips is None:
        wrong_side = shoulders[:, 0].mean() < 0
    else:
        wrong_side = ((body.hips[1] - body.hips[0]) * shoulders).sum(axis=-1).mean() < 0
    front = _unit(np.cross(shoulders, body.points[:, NECK] - body.points[:, SPINE]))
    bend, bent = _elbow_bend(body.points, front)
    backward = bent > BENT and bend < BACKWARD_BEND
    if not (wrong_side or backward):
        return
    nose_says = _nose_says(body, motion, front)
    what = []
    if wrong_side:
        against = "at -x" if body.hips is None else "on the side of the right hip"
        what.append(f"the left shoulder is {against}")
    if backward:
        what.append(f"the elbows bend backwards ({bend:+.2f} of their bend is forward)")
    if nose_says is not None:
        what.append(f"the nose is {'in front' if nose_says else 'behind'}")
    # A person can hold the hands behind the back; then the nose is where it should be.
    doubtful = not wrong_side and nose_says is True
    yield Finding(
        Check.SIDES,
        Severity.WARNING if doubtful else Severity.ERROR,
        files.motion,
        "; ".join(what),
        "are the hands behind the back? If not, left and right are exchanged"
        if doubtful
        else "exchange the left and right joints, or mirror one axis back: x if the picture was"
        " mirrored, z if the system was left-handed",
    )


def _nose_says(body: Body, motion: Motion, front: NDArray[np.float64]) -> bool | None:
    """Whether the nose is in front; None where that isn't known."""
    if body.own[NOSE] and body.joints[NOSE] not in (body.joints[HEAD], body.joints[NECK]):
        nose = body.points[:, NOSE] - (body.points[:, NECK] + body.points[:, HEAD]) / 2
        forward = float((nose * front).sum(axis=-1).mean())
    elif motion.rotations_local is not None:
        step = max(1, len(motion) // NOSE_FRAMES)
        few = Motion(
            motion.skeleton, motion.fps, motion.positions[::step], motion.rotations_local[::step]
        )
        points = to_upper_body(few).positions
        forward = float((points[:, NOSE] - (points[:, NECK] + points[:, HEAD]) / 2)[:, 2].mean())
    else:
        return None
    forward /= body.scale
    return forward > 0 if abs(forward) > FORWARD_NOSE_M else None


def _elbow_bend(points: NDArray[np.float64], front: NDArray[np.float64]) -> tuple[float, float]:
    """Forward share of both elbows' bend, and the mean size of the bend."""
    forward, size = 0.0, 0.0
    for shoulder, elbow, wrist in (LEFT_ARM, RIGHT_ARM):
        upper = _unit(points[:, elbow] - points[:, shoulder])
        fore = _unit(points[:, wrist] - points[:, elbow])
        bend = fore - (fore * upper).sum(axis=-1, keepdims=True) * upper
        forward += float((bend * front).sum(axis=-1).mean()) / 2
        size += float(np.linalg.norm(bend, axis=-1).mean()) / 2
    return forward / max(size, 1e-9), size


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def check_picture(motion: Motion, files: Files) -> Iterator[Finding]:
    """Whether keypoints of a picture are upright and the left shoulder is at +x.

    Args:
        motion: Two-dimensional; joints called ``left_shoulder``, ``left_elbow`` and so on.
        files: What to call them.
    """
    index = motion.skeleton.index
    names = [f"{side}_{joint}" for side in ("left", "right") for joint in ("shoulder", "elbow")]
    if motion.dimensions != 2 or len(motion) == 0 or any(name not in index for name in names):
        return
    places = motion.positions[:, [index[name] for name in names]].astype(np.float64)
    left, left_elbow, right, right_elbow = places.mean(axis=0)
    width = float(np.linalg.norm(left - right)) or 1.0
    if (left_elbow + right_elbow - left - right)[1] / 2 > UPSIDE_DOWN * width:
        yield Finding(
            Check.VERTICAL,
            Severity.ERROR,
            files.motion,
            "the elbows are above the shoulders: y points down",
            "turn the sign of y",
        )
        return
    if (left - right)[0] < 0:
        yield Finding(
            Check.SIDES,
            Severity.ERROR,
            files.motion,
            "the left shoulder is at -x of the right one",
            "exchange left and right, or turn the sign of x; a speaker with the back to the"
            " camera looks the same",
        )
        return
