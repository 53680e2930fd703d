"""From speech of any length to motion, and from gesturing joints to the evaluation's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor

from cospeech.motion.gesture_joints import GestureJoints
from cospeech.motion.joint_map import EVALUATION_JOINTS
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import EVALUATION_FPS

LongForm = Literal["crossfade", "carry", "reset"]
"""How speech longer than a window is made. ``"crossfade"``: windows that overlap by two seconds,
one faded into the next. ``"carry"``: one pass, the GRU's state carried on. ``"reset"``: windows
side by side, as in training."""

OVERLAP_FRAMES = 40
"""Of two windows that are faded into one another, 2 s. Two windows of the same speech can be far
apart; within 1 s the way from one to the next would be faster than the motion around it."""


def long_poses(
    generate: Callable[[Tensor], Tensor], speech: Tensor, frames: int, long_form: LongForm
) -> Tensor:
    """Poses for speech of any length.

    Args:
        generate: ``(B, T, C)`` speech to ``(B, T, D)`` poses, causal in T.
        speech: ``(T, C)``.
        frames: Length of a window.
        long_form: How windows are joined.

    Returns:
        ``(T, D)``.
    """
    total = len(speech)
    if total <= frames or long_form == "carry":
        return generate(speech[None])[0]
    overlap = OVERLAP_FRAMES if long_form == "crossfade" else 0
    # The last window begins where there is more left than the one before covers.
    starts = range(0, total - overlap, frames - overlap)
    padded = torch.cat([speech, speech.new_zeros(frames, speech.shape[1])])
    windows = generate(torch.stack([padded[start : start + frames] for start in starts]))
    poses = windows.new_zeros(total + frames, windows.shape[2])
    place = torch.arange(1, overlap + 1, device=poses.device)[:, None] / (overlap + 1)
    # Level at both ends: neither joints nor their velocities jump where a fade begins or ends.
    shares = place.square() * (3 - 2 * place)
    for start, window in zip(starts, windows, strict=True):
        if start and overlap:
            before = poses[start : start + overlap]
            window = window.clone()
            window[:overlap] = before + shares * (window[:overlap] - before)
        poses[start : start + frames] = window
    return poses[:total]


def evaluation_joints(joints: Tensor, layout: GestureJoints, head: Tensor) -> Tensor:
    """The ten upper-body joints of gesturing joints.

    Spine, neck, shoulders, elbows and wrists are among them; nose and head are put above the neck
    at the corpus's mean offsets, as no joint says how the head is turned.

    Args:
        joints: ``(..., J, 3)`` in the order of ``layout.roles``.
        layout: The gesturing joints.
        head: ``(2, 3)`` offsets from the neck to the nose and to the head, metres.

    Returns:
        ``(..., 10, 3)`` relative to the spine.
    """
    neck = joints[..., layout.roles.index("neck"), :]
    points = []
    for name in EVALUATION_JOINTS:
        if name == "spine":
            points.append(joints[..., layout.evaluation_spine, :])
        elif name in ("nose", "head"):
            points.append(neck + head[int(name == "head")])
        else:
            points.append(joints[..., layout.roles.index(name), :])
    upper_body = torch.stack(points, dim=-2)
    return upper_body - upper_body[..., :1, :]


def head_offsets(mean_direction: list[float], bone_lengths: list[float]) -> Tensor:
    """Mean offsets from the neck to nose and head, from the facts of a corpus.

    Returns:
        ``(2, 3)`` metres: bone length times unit mean direction, added up along neck, nose, head.
    """
    directions = torch.tensor(mean_direction).unflatten(0, (9, 3))[1:3]
    bones = (
        torch.nn.functional.normalize(directions, dim=-1) * torch.tensor(bone_lengths)[1:3, None]
    )
    return bones.cumsum(dim=0)


def at_evaluation_rate(positions: Tensor, fps: float) -> Tensor:
    """Windows at the evaluation rate, by linear interpolation between steps.

    Args:
        positions: ``(B, T, J, 3)`` at ``fps``.
        fps: Their rate.

    Returns:
        ``(B, floor((T - 1) / fps * 15) + 1, J, 3)``; frame j shows time ``j / 15``.
    """
    steps = positions.shape[1]
    count = math.floor((steps - 1) / fps * EVALUATION_FPS + 1e-6) + 1
    places = torch.arange(count, dtype=torch.float64, device=positions.device) * fps
    places = (places / EVALUATION_FPS).clamp(max=steps - 1)
    low = places.floor().long()
    high = (low + 1).clamp(max=steps - 1)
    share = (places - low).to(positions)[:, None, None]
    return positions[:, low] + share * (positions[:, high] - positions[:, low])


def gesture_skeleton(layout: GestureJoints) -> tuple[Skeleton, list[int]]:
    """The gesturing joints as a skeleton: spine first, arms hanging on the neck.

    Returns:
        The skeleton, its joints named by their roles, and their indices among ``layout.roles``.
    """
    arms = set(layout.arms)
    order = [i for i in range(len(layout.roles)) if i not in arms] + list(layout.arms)
    parent = {child: above for above, child in layout.bones}
    place = {joint: i for i, joint in enumerate(order)}
    parents = tuple(place[parent[joint]] if joint in parent else -1 for joint in order)
    names = tuple(layout.roles[joint] for joint in order)
    return Skeleton("gesture_joints", names, parents), order
