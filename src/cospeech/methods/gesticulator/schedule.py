"""How much of its own past the network sees in training, by epoch.

See docs/facts/trinity_and_gesticulator.md, section 4.5.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import torch
from torch import Tensor

Schedule = Literal["paper", "released", "forced", "own"]

EPOCHS_WITHOUT = 7
"""First epochs, in which poses are not conditioned on earlier ones."""

_PAPER = (None, 16, 8, 4, 1)
"""Of how many frames two are the network's own, by epoch; None: recorded ones alone."""

_RELEASED = (8, 4, 2)
"""Of how many frames two are followed by recorded ones, by epoch."""


class History(NamedTuple):
    """What poses are conditioned on.

    Attributes:
        is_conditioned: Whether on anything at all.
        is_reset: ``(T,)``, after which frames the last poses are recorded ones.
    """

    is_conditioned: bool
    is_reset: Tensor


def history_of_epoch(
    epoch: int, schedule: Schedule, first: int, frames: int, epochs_without: int = EPOCHS_WITHOUT
) -> History:
    """The history of an epoch's windows.

    ``"paper"``: recorded poses for one epoch, then the network's own after two frames in every 16,
    8 and 4 for an epoch each, then after all. ``"released"`` is the published code's, which goes
    the other way: recorded poses after two frames in every 8, 4 and 2, the last for ever.
    ``"forced"`` and ``"own"`` stay at either end.

    Args:
        epoch: From 0.
        schedule: Which.
        first: Number of the window's first pose, from which frames are counted.
        frames: Poses of a window, T.
        epochs_without: First epochs without a history.
    """
    place = torch.arange(first, first + frames)
    since = epoch - epochs_without
    if since < 0:
        return History(False, torch.zeros(frames, dtype=torch.bool))
    if schedule == "released":
        return History(True, place % _RELEASED[min(since, len(_RELEASED) - 1)] < 2)
    own = {"forced": None, "own": 1, "paper": _PAPER[min(since, len(_PAPER) - 1)]}[schedule]
    if own is None:
        return History(True, torch.ones(frames, dtype=torch.bool))
    return History(True, place % own >= 2 if own > 1 else torch.zeros(frames, dtype=torch.bool))
