"""From hand targets and posture to joint rotations.

Arms and legs are two-bone chains with an elbow or knee that bends one way only; every pose comes
out as rotations of rigid bones, so bone lengths can't change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cospeech.corpus.synthetic.skeleton import (
    ANKLE_HEIGHT_M,
    FINGERS,
    FOREARM_M,
    MID_SHOULDERS_M,
    SHIN_M,
    SIDES,
    SKELETON,
    THIGH_M,
    UPPER_ARM_M,
)
from cospeech.motion.kinematics import (
    euler_to_quaternion,
    forward_kinematics,
    invert_quaternions,
    multiply_quaternions,
    rotate_vectors,
)

_Array = NDArray[np.float64]

HAND_CHANNELS = 12
"""Numbers that describe a hand.

0 to 2: wrist outwards from the midline, up and forward of the point between the shoulders, m, in
the frame of the chest. 3: pronation of the forearm (0 thumb up, positive palm down), 4: wrist
flexion towards the palm, 5: wrist deviation towards the thumb, 6 to 10: bend of each finger joint
from thumb to little finger, 11: spread of the fingers; rad.
"""
POSITION = slice(0, 3)
PRONATION, FLEXION, DEVIATION, SPREAD = 3, 4, 5, 11
CURLS = slice(6, 11)

_REACH = 0.985  # of the arm's length: a locked elbow looks wrong and makes its direction undefined
_CHEST_HALF_WIDTH_M, _CHEST_FRONT_M, _CHEST_EDGE_M = 0.17, 0.135, 0.08
_JOINT_SHARE = (0.85, 1.0, 0.6)  # of a finger's bend, from the knuckle outwards
_SPREAD_SHARE = {"Index": 0.25, "Middle": 0.05, "Ring": -0.12, "Pinky": -0.32}


@dataclass(frozen=True, eq=False)
class Posture:
    """Trunk, head and feet over time.

    Attributes:
        hips: ``(T, 3)`` world position, m; lowered where the feet would leave the floor.
        hips_turn: ``(T, 3)`` pitch, yaw, roll of the hips, rad; pitch is forward, yaw to the left.
        spine: ``(T, 3)`` the same for the whole spine, spread over its four joints.
        head: ``(T, 3)`` the same for neck and head together.
        stance: Yaw of the feet, rad.
        elbow: How far the elbows point outwards.
    """

    hips: _Array
    hips_turn: _Array
    spine: _Array
    head: _Array
    stance: float
    elbow: float


def keep_clear(hands: _Array) -> _Array:
    """Wrist targets moved out of the trunk and into reach, smoothly.

    Args:
        hands: ``(T, 2, 12)``, left hand first.

    Returns:
        A copy with the first three channels corrected.
    """
    hands = hands.copy()
    outward, forward = hands[..., 0], hands[..., 2]
    # the front of the chest; beside the trunk the arms may hang
    beside = np.clip((np.abs(outward) - _CHEST_HALF_WIDTH_M) / _CHEST_EDGE_M, 0, 1)
    front = _CHEST_FRONT_M - 0.30 * beside * beside * (3 - 2 * beside)
    softness = 0.012
    hands[..., 2] = front + softness * np.logaddexp(0, (forward - front) / softness)
    shoulder = np.array([0.18, 0.0, 0.0])
    arm = hands[..., POSITION] - shoulder
    length = np.sqrt(np.sum(arm * arm, axis=-1, keepdims=True))
    limit, knee = _REACH * (UPPER_ARM_M + FOREARM_M), 0.03
    excess = np.maximum(length - (limit - knee), 0)
    shortened = np.minimum(length, limit - knee) + knee * np.tanh(excess / knee)
    hands[..., POSITION] = shoulder + arm * (shortened / length)
    return hands


def pose_body(hands: _Array, posture: Posture) -> tuple[_Array, _Array]:
    """Joint rotations that put the wrists where they should be.

    Args:
        hands: ``(T, 2, 12)``, left hand first, as `keep_clear` returns them.
        posture: The rest of the body.

    Returns:
        ``positions_world (T, J, 3)`` and ``rotations_local (T, J, 4)`` on `SKELETON`.
    """
    frames = len(hands)
    rotations = np.zeros((frames, len(SKELETON), 4))
    rotations[..., 3] = 1.0
    index = SKELETON.index
    rotations[:, index["Hips"]] = _turn(posture.hips_turn)
    hips = posture.hips.copy()
    hips[:, 1] -= _too_high(hips, rotations[:, index["Hips"]], posture.stance)
    for joint in ("Spine", "Spine1", "Spine2", "Spine3"):
        rotations[:, index[joint]] = _turn(posture.spine / 4)
    for joint, share in (("Neck", 0.3), ("Neck1", 0.2), ("Head", 0.5)):
        rotations[:, index[joint]] = _turn(posture.head * share)
    chest = rotations[:, index["Hips"]]
    for joint in ("Spine", "Spine1", "Spine2", "Spine3"):
        chest = multiply_quaternions(chest, rotations[:, index[joint]])
    for side in range(2):
        _pose_arm(rotations, side, hands[:, side], chest, posture.elbow)
        _pose_leg(rotations, side, hips, posture.stance)
    translations = np.repeat(_offsets()[None], frames, axis=0)
    translations[:, 0] = hips
    positions, _ = forward_kinematics(SKELETON.parents, translations, rotations)
    return positions, rotations


def _offsets() -> _Array:
    assert SKELETON.offsets is not None
    return SKELETON.offsets


def _turn(angles: _Array) -> _Array:
    """Quaternions from pitch, yaw, roll; roll to the speaker's right is positive."""
    return euler_to_quaternion(angles[..., [1, 0, 2]] * (1, 1, -1), "YXZ")


def _pose_arm(rotations: _Array, side: int, hand: _Array, chest: _Array, elbow: float) -> None:
    """Fills in one arm; works in the frame of the chest, where the targets live."""
    name, sign = SIDES[side], (1.0, -1.0)[side]
    index, offsets = SKELETON.index, _offsets()
    target = MID_SHOULDERS_M + hand[:, POSITION] * (sign, 1.0, 1.0)
    # the shoulder girdle follows the hand: up when it rises, forward when it reaches
    raised = 0.22 * np.clip(hand[:, 1] + 0.30, 0, 0.5)
    reached = 0.35 * np.clip(hand[:, 2] - 0.15, -0.1, 0.4)
    clavicle = euler_to_quaternion(np.stack([-sign * reached, sign * raised], axis=-1), "YZ")
    rotations[:, index[f"{name}Shoulder"]] = clavicle
    shoulder = offsets[index[f"{name}Shoulder"]] + rotate_vectors(
        clavicle, offsets[index[f"{name}Arm"]]
    )
    pole = np.array([sign * elbow, -1.0, -0.35])
    upper, bend, angle = _two_bones(target - shoulder, pole, UPPER_ARM_M, FOREARM_M)
    # rest frame: bone along ±x, palm down, thumb (the side the elbow flexes to) along +z
    x = sign * upper
    frame = np.stack([x, np.cross(bend, x), bend], axis=-1)
    upper_in_chest = _quaternions(frame)
    rotations[:, index[f"{name}Arm"]] = multiply_quaternions(
        invert_quaternions(clavicle), upper_in_chest
    )
    rotations[:, index[f"{name}ForeArm"]] = euler_to_quaternion(
        np.stack([-sign * angle, hand[:, PRONATION]], axis=-1), "YX"
    )
    rotations[:, index[f"{name}Hand"]] = euler_to_quaternion(
        np.stack([-sign * hand[:, DEVIATION], -sign * hand[:, FLEXION]], axis=-1), "YZ"
    )
    for k, finger in enumerate(FINGERS):
        bend_angle = hand[:, CURLS][:, k]
        for i, share in enumerate(_JOINT_SHARE, start=1):
            if finger == "Thumb":
                # towards the root of the index finger
                axis = np.array([0.21, sign * 0.68, -sign * 0.70])
                turn = Rotation.from_rotvec(np.outer(0.6 * share * bend_angle, axis)).as_quat()
            else:
                spread = _SPREAD_SHARE[finger] * hand[:, SPREAD] * (i == 1)
                turn = euler_to_quaternion(
                    np.stack([-sign * spread, -sign * share * bend_angle], axis=-1), "YZ"
                )
            rotations[:, index[f"{name}Hand{finger}{i}"]] = turn


def _leg(hips: _Array, hips_turn: _Array, stance: float, side: int) -> _Array:
    """From hip joint to ankle, ``(T, 3)``; the ankle stays on its spot."""
    name, sign = SIDES[side], (1.0, -1.0)[side]
    hip_joint = hips + rotate_vectors(hips_turn, _offsets()[SKELETON.index[f"{name}UpLeg"]])
    standing = euler_to_quaternion(np.array([stance]), "Y")
    return rotate_vectors(standing, np.array([sign * 0.115, ANKLE_HEIGHT_M, 0.0])) - hip_joint


def _too_high(hips: _Array, hips_turn: _Array, stance: float) -> _Array:
    """By how much the hips must sink for both feet to stay on the floor, ``(T,)`` m."""
    drops = []
    for side in range(2):
        leg = _leg(hips, hips_turn, stance, side)
        longest = 0.9985 * (THIGH_M + SHIN_M)
        drops.append(-leg[:, 1] - np.sqrt(longest**2 - leg[:, 0] ** 2 - leg[:, 2] ** 2))
    softness = 0.001
    return softness * np.logaddexp(0, np.maximum(*drops) / softness)


def _pose_leg(rotations: _Array, side: int, hips: _Array, stance: float) -> None:
    """Fills in one leg, with the foot flat on its spot."""
    name, sign = SIDES[side], (1.0, -1.0)[side]
    index = SKELETON.index
    hips_turn = rotations[:, index["Hips"]]
    foot_turn = euler_to_quaternion(np.array([stance + sign * 0.16]), "Y")
    pole = rotate_vectors(foot_turn, np.array([0.0, 0.0, 1.0]))
    leg = _leg(hips, hips_turn, stance, side)
    thigh, bend, angle = _two_bones(leg, pole, THIGH_M, SHIN_M)
    forward = -bend
    frame = np.stack([np.cross(-thigh, forward), -thigh, forward], axis=-1)
    upper = _quaternions(frame)
    knee = euler_to_quaternion(angle[:, None], "X")
    rotations[:, index[f"{name}UpLeg"]] = multiply_quaternions(invert_quaternions(hips_turn), upper)
    rotations[:, index[f"{name}Leg"]] = knee
    shin = multiply_quaternions(upper, knee)
    rotations[:, index[f"{name}Foot"]] = multiply_quaternions(invert_quaternions(shin), foot_turn)


def _quaternions(frames: _Array) -> _Array:
    """Quaternions of rotation matrices ``(T, 3, 3)``, without jumps to the opposite sign."""
    quaternions = Rotation.from_matrix(frames).as_quat()
    same_side = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) >= 0
    signs = np.cumprod(np.where(same_side, 1.0, -1.0))
    quaternions[1:] *= signs[:, None]
    return quaternions


def _two_bones(
    reach: _Array, pole: _Array, first: float, second: float
) -> tuple[_Array, _Array, _Array]:
    """Solves a two-bone chain.

    Args:
        reach: ``(T, 3)`` from its root to its end.
        pole: ``(3,)`` direction to which the middle joint leans.
        first: Length of the first bone, m.
        second: Length of the second, m.

    Returns:
        Direction of the first bone ``(T, 3)``, direction in which the second bends away from it
        ``(T, 3)``, and by what angle ``(T,)``.
    """
    length = np.sqrt(np.sum(reach * reach, axis=-1))
    axis = reach / length[:, None]
    length = np.clip(length, abs(first - second) + 1e-3, (first + second) * 0.9995)
    lean = pole - axis * np.sum(axis * pole, axis=-1, keepdims=True)
    lean /= np.sqrt(np.sum(lean * lean, axis=-1, keepdims=True))
    cosine = (length**2 + first**2 - second**2) / (2 * length * first)
    sine = np.sqrt(1 - cosine * cosine)
    bone = axis * cosine[:, None] + lean * sine[:, None]
    bend = axis * sine[:, None] - lean * cosine[:, None]
    bent = np.arccos((length**2 - first**2 - second**2) / (2 * first * second))
    return bone, bend, bent
