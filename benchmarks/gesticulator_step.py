"""Seconds per training step of Gesticulator, beside encoding every window's frames anew.

A frame of speech is in 30 windows. The published code encodes it in each, so that dropout hides
other units every time (``mask_per_window=true``); by default it is encoded once. Two networks that
begin alike take turns on the same batches, without dropout, so that they meet the same machine and
their losses can be compared. A step is the forward pass, the losses of poses and velocities, the
backward pass and Adam's step, on the last epoch's schedule: every pose from the network's own.

Prints a line and, as the last one, the same as JSON. Run: python benchmarks/gesticulator_step.py
"""

from __future__ import annotations

import argparse
import copy
import json
import statistics
import sys
import time
from pathlib import Path

import torch
from torch import Tensor

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.methods.gesticulator.losses import pose_loss, velocity_loss
from cospeech.methods.gesticulator.networks import AHEAD, HISTORY, PAST, GesticulatorNetwork

FRAMES, POSE_SIZE, VELOCITY_WEIGHT, LEARNING_RATE = 40, 45, 0.6, 1e-4


class Training:
    """A network and its optimiser.

    Args:
        network: The network, of which a copy is trained.
        mask_per_window: Encode every window's frames anew.
    """

    def __init__(self, network: GesticulatorNetwork, mask_per_window: bool) -> None:
        self.network = copy.deepcopy(network).train()
        self.mask_per_window = mask_per_window
        self.optimizer = torch.optim.Adam(self.network.parameters(), LEARNING_RATE)
        self.seconds, self.losses = list[float](), list[float]()

    def step(self, speech: Tensor, truth: Tensor) -> None:
        """One step, timed."""
        began = time.perf_counter()
        said = self.network.encode(speech, self.mask_per_window)
        poses = self.network.roll(said, truth[:, :1].expand(-1, HISTORY, -1))
        loss = pose_loss(poses, truth) + VELOCITY_WEIGHT * velocity_loss(poses, truth)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.losses.append(loss.item())
        self.seconds.append(time.perf_counter() - began)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--speech-size", type=int, default=837, help="64 bands, 768 + 5 of text")
    parser.add_argument("--steps", type=int, default=6)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.manual_seed(0)

    network = GesticulatorNetwork(
        arguments.speech_size, POSE_SIZE, dropout=0.0, conditioning_dropout=0.0, initialisation="he"
    )
    once, anew = Training(network, False), Training(network, True)
    for _ in range(arguments.steps + 1):
        speech = torch.randn(arguments.batch, PAST + FRAMES + AHEAD, arguments.speech_size)
        truth = torch.randn(arguments.batch, FRAMES, POSE_SIZE)
        for training in (once, anew):
            training.step(speech, truth)
    # The first step of each sets up memory.
    once_s, anew_s = (statistics.median(training.seconds[1:]) for training in (once, anew))
    apart = max(abs(a / b - 1) for a, b in zip(once.losses, anew.losses, strict=True))
    row = {
        "once_s": once_s,
        "per_window_s": anew_s,
        "ratio": anew_s / once_s,
        "losses_apart": apart,
    }
    print(
        f"a step of {arguments.batch} windows: {once_s:.3f} s with frames encoded once,"
        f" {anew_s:.3f} s per window, {row['ratio']:.1f} times as long;"
        f" losses of {arguments.steps + 1} steps differ by {apart:.1e} of them at most"
    )
    print(json.dumps({"benchmark": "gesticulator_step", **vars(arguments), **row}))


if __name__ == "__main__":
    main()
