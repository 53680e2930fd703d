"""Seconds per training step of each stage of the multi-adversary method, on random batches.

Adversaries read windows with an LSTM; beside it is the same step with GRUs, as the generator has
one. Both take turns on the same batch, so that they meet the same machine. The last column is the
rate of the GRU's arithmetic over that of one large matrix product.

    python benchmarks/multi_adversary_step.py --steps 5
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import torch
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.flop_counter import FlopCounterMode

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.synthetic import SKELETON
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.multi_adversary.networks import SequenceDiscriminator
from cospeech.methods.multi_adversary.staging import STAGES
from cospeech.training.stages import Progress

ROOT = Path(__file__).resolve().parents[1]


class WithGru(nn.Module):
    """A discriminator's layers around a GRU of the same size."""

    def __init__(self, original: SequenceDiscriminator) -> None:
        super().__init__()
        self.dense, self.dropout, self.output = original.dense, original.dropout, original.output
        lstm = original.lstm
        self.gru = nn.GRU(lstm.input_size, lstm.hidden_size, batch_first=True)

    def forward(self, windows: Tensor) -> Tensor:
        """As the original."""
        _, last = self.gru(self.dropout(functional.relu(self.dense(windows))))
        return torch.sigmoid(self.output(last[-1])).squeeze(-1)


def build(overrides: list[str]) -> tuple[MultiAdversary, int]:
    """The method of a configuration, untrained, and its batch size."""
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        cfg = compose("train", ["model=multi_adversary", *overrides])
    settings: Any = OmegaConf.to_container(cfg.model)
    settings = {k: v for k, v in settings.items() if not k.startswith("_")}
    settings |= {"products_dir": None, "classifier": None}
    facts: Any = {
        "skeleton": SKELETON.to_dict(),
        "fingerprint": "",
        "speakers": [],
        "mean_direction": [0.0, 1.0, 0.0] * 9,
        "bone_lengths": [0.2] * 9,
    }
    torch.manual_seed(0)
    return MultiAdversary(facts, **settings), int(cfg.training.batch_size)


def random_batch(size: int, joints: int) -> GestureBatch:
    """Noise in the shapes of a training batch."""
    return GestureBatch(
        window_ids=torch.arange(size),
        joints=torch.randn(size, 100, joints, 3) * 0.1,
        acoustics=torch.randn(size, 100, 27),
        phases=torch.randint(9, (size, 100)),
    )


class Stepper:
    """A method's steps with optimisers of their own, without Lightning around them."""

    def __init__(self, overrides: list[str], gru: bool) -> None:
        self.method, size = build(overrides)
        players = self.method.players
        self.batch = random_batch(size, len(self.method.layout.roles))
        players.fit_scales([self.batch], list(self.method.layout.arms))
        assert players.student is not None
        self.method.views.classifier = players.student.frozen()
        if gru:
            for adversary in players.adversaries.values():
                if isinstance(adversary.discriminator, SequenceDiscriminator):
                    adversary.discriminator = WithGru(adversary.discriminator)
        self.optimizers = {
            name: kind(network.parameters(), lr=rate)
            for name, (kind, network, rate) in self.method._optimizers().items()
        }
        self.method.steps._descend = self.descend
        self.method.history.note(0, players.generator)

    def descend(self, name: str, loss: Tensor, largest_norm: float | None = None) -> None:
        """One step of an optimiser."""
        self.optimizers[name].zero_grad()
        loss.backward()
        self.optimizers[name].step()

    def step(self, stage: str) -> None:
        """One step; of the adversarial stage two, of which one has an objective step."""
        for number in range(2 if stage == "adversarial" else 1):
            self.method.steps.take(Progress(stage, number + 1), self.batch)


def matmul_rate() -> float:
    """FLOP/s of a product of two (1024, 1024) matrices."""
    left, best = torch.randn(1024, 1024), float("inf")
    for _ in range(10):
        start = time.perf_counter()
        left @ left
        best = min(best, time.perf_counter() - start)
    return 2 * 1024**3 / best


def main() -> None:
    """Measure and print a table and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=5, help="timed steps of each kind")
    arguments = parser.parse_args()
    limit, results = matmul_rate(), list[dict[str, Any]]()
    print(f"{torch.get_num_threads()} threads, torch {torch.__version__}")
    print("| sizes | batch | stage | LSTM, s | GRU, s | speed | GFLOP (GRU) | of matmul |")
    print("| --- | ---: | --- " + "| ---: " * 5 + "|")
    for sizes, overrides in (("quick", ["experiment=multi_adversary_quick"]), ("full", [])):
        steppers = {kind: Stepper(overrides, gru=kind == "gru") for kind in ("lstm", "gru")}
        for stage in STAGES:
            seconds: dict[str, list[float]] = {kind: [] for kind in steppers}
            with FlopCounterMode(display=False) as counter:
                steppers["gru"].step(stage)
            steppers["lstm"].step(stage)
            for _ in range(arguments.steps):
                for kind, stepper in steppers.items():
                    start = time.perf_counter()
                    stepper.step(stage)
                    seconds[kind].append(time.perf_counter() - start)
            count = 2 if stage == "adversarial" else 1
            # The fastest step: other programs on the machine only ever add time.
            best = {kind: min(found) / count for kind, found in seconds.items()}
            work = counter.get_total_flops() / count
            share = work / best["gru"] / limit
            batch = len(steppers["lstm"].batch)
            print(
                f"| {sizes} | {batch} | {stage} | {best['lstm']:.3f} | {best['gru']:.3f} |"
                f" {best['gru'] / best['lstm']:.2f} | {work / 1e9:.1f} | {share:.0%} |",
                flush=True,
            )
            results.append({"sizes": sizes, "batch": batch, "stage": stage, **best, "flop": work})
    print(json.dumps(results))


if __name__ == "__main__":
    main()
