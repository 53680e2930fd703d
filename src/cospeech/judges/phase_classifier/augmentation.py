"""What training windows go through, so that no two epochs are the same."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from cospeech.corpus.windows import WindowSpec


def cut_at_random(
    joints: Tensor, pitch: Tensor | None, phases: Tensor, spec: WindowSpec
) -> tuple[Tensor, Tensor | None, Tensor]:
    """As many windows as came, cut at random places from the runs that they make.

    Args:
        joints: ``(B, T, J, 3)``; ``spec.run`` consecutive windows make a run.
        pitch: ``(B, T)``, or None.
        phases: ``(B, T)``.
        spec: Of the windows.

    Returns:
        The same shapes. With runs of one window all is as it was.
    """
    run, frames = spec.run, spec.frames
    if run == 1:
        return joints, pitch, phases
    runs, device = len(joints) // run, joints.device
    starts = torch.randint((run - 1) * frames + 1, (runs * run, 1), device=device)
    rows = torch.arange(runs, device=device).repeat_interleave(run)[:, None]
    steps = starts + torch.arange(frames, device=device)

    def cut(values: Tensor) -> Tensor:
        return values.unflatten(0, (runs, run)).flatten(1, 2)[rows, steps]

    return cut(joints), None if pitch is None else cut(pitch), cut(phases)


def mirrored(joints: Tensor, roles: Sequence[str]) -> Tensor:
    """What a mirror shows: sides exchanged, x negated.

    Args:
        joints: ``(..., J, 3)`` in the body frame.
        roles: Names of the J joints; all are on a side.
    """
    other = {"left": "right", "right": "left"}
    parts = [role.partition("_") for role in roles]
    swapped = [list(roles).index(f"{other[side]}_{joint}") for side, _, joint in parts]
    return joints[..., swapped, :] * joints.new_tensor([-1.0, 1.0, 1.0])


def random_sizes(joints: Tensor, jitter: float) -> Tensor:
    """A factor per window, ``(B, 1, 1, 1)``: ``exp`` of uniform between plus and minus jitter."""
    draws = torch.rand(len(joints), 1, 1, 1, device=joints.device)
    return torch.exp((2 * draws - 1) * jitter)
