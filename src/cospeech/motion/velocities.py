"""Joint velocities as a person's body sees them: what phase classifiers look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import EVALUATION_JOINTS, bare_names, find_joint_map
from cospeech.motion.kinematics import heading_angles, turn_about_vertical
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton


@dataclass(frozen=True)
class BodyJoints:
    """The joints whose velocities are wanted, and the body frame they are seen in.

    Attributes:
        joints: Joint names, in the order of the features.
        reference: The joint that counts as standing still: the body's travel is gone.
        sideways: Right and left joint (hips) whose direction, seen from above, is the body's x: its
            heading is gone. None where the motion faces +z already.
    """

    joints: tuple[str, ...]
    reference: str
    sideways: tuple[str, str] | None = None


def wrists(skeleton: Skeleton) -> BodyJoints:
    """Left and right wrist relative to the spine, on any skeleton with a joint map.

    A skeleton that calls its joints ``left_wrist``, ``right_wrist`` and ``spine`` needs no map, and
    is taken to face +z.

    Raises:
        CospeechError: No joint map fits the skeleton, or it puts a wrist between joints.
    """
    names = ("left_wrist", "right_wrist", "spine")
    if set(names) <= set(skeleton.joints):
        return BodyJoints(names[:2], names[2])
    joint_map = find_joint_map(skeleton)
    places = [joint_map.joints[EVALUATION_JOINTS.index(name)].needed for name in names]
    if max(map(len, places)) > 1:
        raise CospeechError(
            f"joint map {joint_map.name} has no single joint for {', '.join(names)}"
        )
    left, right, spine = (joint for (joint, *_) in places)
    return BodyJoints((left, right), spine, joint_map.hips)


def body_positions(motion: Motion, joints: BodyJoints) -> NDArray[np.float32]:
    """Positions in the body frame: metres; x to the body's left, y up, z forward.

    Returns:
        ``(T, J, 3)`` float32, J as ``joints.joints``.

    Raises:
        CospeechError: The motion is 2-D, or its skeleton lacks a joint.
    """
    if motion.dimensions != 3:
        raise CospeechError("2-D keypoints have no velocities in metres per second")
    names = bare_names(motion.skeleton)
    wanted = (*joints.joints, joints.reference, *(joints.sideways or ()))
    if missing := sorted(set(wanted) - set(names)):
        raise CospeechError(
            f"skeleton {motion.skeleton.name!r} has no {', '.join(missing)}; it has"
            f" {', '.join(motion.skeleton.joints)}"
        )
    chosen = [names[joint] for joint in joints.joints]
    reference = motion.positions[:, names[joints.reference], None].astype(np.float64)
    positions = motion.positions[:, chosen] - reference
    if joints.sideways is not None and len(motion):
        right, left = (motion.positions[:, names[joint]] for joint in joints.sideways)
        angles = heading_angles(right, left)
        if angles is None:
            raise CospeechError(
                f"{joints.sideways[0]} and {joints.sideways[1]} are never apart, so the body's"
                " heading is unknown"
            )
        positions = turn_about_vertical(positions, angles)
    return positions.astype(np.float32)


def velocities(positions: Tensor, fps: float, speeds: bool) -> Tensor:
    """Velocity of every joint at every step but the first, and its speed where wanted.

    ``v[t] = (p[t] - p[t-1]) * fps``. Differentiable, also where a joint stands still.

    Args:
        positions: ``(..., T, J, 3)``, from `body_positions`.
        fps: Steps per second.
        speeds: Whether to add each joint's ``|v|``.

    Returns:
        ``(..., T - 1, 3 J)``, or ``(..., T - 1, 4 J)`` with the J speeds last.
    """
    steps = (positions[..., 1:, :, :] - positions[..., :-1, :, :]) * fps
    if not speeds:
        return steps.flatten(-2)
    # The root has no slope at 0; the added square is a tenth of a millimetre per second.
    lengths = (steps.square().sum(-1) + 1e-8).sqrt()
    return torch.cat([steps.flatten(-2), lengths], dim=-1)
