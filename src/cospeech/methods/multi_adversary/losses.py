"""The objective losses (Ferstl et al. 2020, section 7.2). Pure functions.

See docs/facts/multi_adversary.md, section 7.
"""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor


def continuity_loss(poses: Tensor, run: int) -> Tensor:
    """Squared distance between a window's first pose and the last of the window before it.

    As the text has it: the penalty of a run's first window is 0. Equation 4 as printed sums the
    squared frame differences inside a window, which would punish all motion.

    Args:
        poses: ``(B, T, D)``; every ``run`` windows are consecutive.
        run: Windows per run.

    Returns:
        Scalar: mean over all windows, first ones included, and over D.

    Raises:
        ValueError: The batch isn't made of whole runs.
    """
    if len(poses) % run:
        raise ValueError(f"{len(poses)} windows are not runs of {run}")
    runs = poses.unflatten(0, (-1, run))
    jumps = runs[:, 1:, 0] - runs[:, :-1, -1]
    return jumps.square().sum() / (len(poses) * poses.shape[-1])


def finger_offsets(joints: Tensor, finger_tips: Sequence[tuple[int, int]]) -> Tensor:
    """Each finger tip seen from its wrist.

    Args:
        joints: ``(..., J, 3)``.
        finger_tips: (tip, wrist) indices.

    Returns:
        ``(..., F, 3)`` in the joints' unit.
    """
    tips, wrists = zip(*finger_tips, strict=True)
    return joints[..., list(tips), :] - joints[..., list(wrists), :]


def finger_loss(generated: Tensor, real: Tensor, deviation: Tensor) -> Tensor:
    """Mean squared difference of finger offsets, in units of their standard deviation (eq. 5).

    Args:
        generated: ``(..., F, 3)`` from `finger_offsets`, metres.
        real: The same shape.
        deviation: ``(F, 3)`` standard deviation of real offsets, metres.

    Returns:
        Scalar.
    """
    return ((generated - real) / deviation).square().mean()
