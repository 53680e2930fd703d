"""Seconds per training step of the trimodal method, beside the published order of passes.

The published code runs the generator three times per step once the adversary plays (twice before):
for the discriminator, for the generator, and for the diversity term. `Trimodal` shares the first
two, shares the encoders with the third, and freezes the discriminator where its gradients would be
thrown away. Both orders run alternately on the same networks, so that they meet the same machine.

    python benchmarks/trimodal_step.py --batch 128 --steps 6
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from typing import Any, cast

import torch
from lightning import Trainer
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor
from torch.utils.data import DataLoader
from torch.utils.flop_counter import FlopCounterMode

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.trimodal import Trimodal
from cospeech.methods.trimodal.chunks import seed_input
from cospeech.methods.trimodal.losses import (
    diversity_loss,
    reconstruction_loss,
    style_divergence,
)
from cospeech.methods.trimodal.networks import GeneratorOutput


class Alternating(Trimodal):
    """Takes turns: our step on even batches, the published order on odd ones.

    See docs/facts/trimodal.md, section 2.2.
    """

    epoch = 0
    count_flops = False

    def record(self) -> None:
        """Forget what was measured."""
        self.seconds: dict[str, list[float]] = {"shared": [], "published": []}
        self.flops: dict[str, int] = {}

    @property
    def current_epoch(self) -> int:
        """The epoch whose schedule is measured."""
        return self.epoch

    def training_step(self, batch: GestureBatch, batch_idx: int) -> dict[str, Tensor]:
        """Time one step of the order whose turn it is."""
        order = "published" if batch_idx % 2 else "shared"
        step = self.published_step if batch_idx % 2 else super().training_step
        if batch_idx < 2:
            with FlopCounterMode(display=False) as counter:
                logged = step(batch, batch_idx)
            self.flops[order] = counter.get_total_flops()
            return logged or {}
        self._wait()
        start = time.perf_counter()
        logged = step(batch, batch_idx)
        self._wait()
        self.seconds[order].append(time.perf_counter() - start)
        return logged or {}

    def _wait(self) -> None:
        if self.device.type == "cuda":
            torch.cuda.synchronize()

    def published_step(self, batch: GestureBatch, batch_idx: int) -> None:
        """The order of the published code, dropping nothing that it computes."""
        generator_optimizer, discriminator_optimizer = cast(
            list[LightningOptimizer], self.optimizers()
        )
        discriminator, losses = self.adversary.discriminator, self.adversary.losses
        target = self.codec.encode(batch.require("positions"))
        seed_poses = seed_input(target[:, :4], 34)
        speakers = batch.require("speakers")
        playing = self.adversary.is_active(self.current_epoch)

        def forward(ids: Tensor) -> GeneratorOutput:
            return self.generator(
                seed_poses,
                batch.require("words"),
                batch.require("audio"),
                ids,
                style_noise=self._style_noise(len(batch)),
            )

        if playing:
            discriminator_optimizer.zero_grad()
            fake = forward(speakers).poses.detach()
            own_loss = losses.discriminator(discriminator(target), discriminator(fake))
            self.manual_backward(own_loss)
            discriminator_optimizer.step()
        generator_optimizer.zero_grad()
        output = forward(speakers)
        adversarial = losses.generator(discriminator(output.poses))
        other = forward(speakers[self._permutation(len(speakers))])
        assert output.z is not None
        assert other.z is not None
        assert output.mu is not None
        assert output.logvar is not None
        loss = (
            self.huber_weight * reconstruction_loss(output.poses, target)
            + self.diversity_weight * diversity_loss(output.poses, other.poses, output.z, other.z)
            + self.kld_weight * style_divergence(output.mu, output.logvar)
        )
        if playing:
            loss = loss + self.adversary.weight * adversarial
        self.manual_backward(loss)
        generator_optimizer.step()


def matmul_rate(batch: int, device: torch.device) -> float:
    """FLOP/s of the product behind the GRU's input projections: (batch * 34, 600) by (600, 900)."""
    left, right = torch.randn(batch * 34, 600, device=device), torch.randn(600, 900, device=device)
    best = float("inf")
    for _ in range(10):
        start = time.perf_counter()
        product = left @ right
        if device.type == "cuda":
            torch.cuda.synchronize()
        best = min(best, time.perf_counter() - start)
    return 2 * left.shape[0] * left.shape[1] * product.shape[1] / best


def random_batch(size: int, words: int, speakers: int) -> GestureBatch:
    """Noise in the shapes of a training batch."""
    return GestureBatch(
        window_ids=torch.arange(size),
        positions=torch.randn(size, 34, 10, 3),
        audio=torch.randn(size, 36_267) * 0.1,
        words=torch.randint(words, (size, 34)) * (torch.rand(size, 34) < 0.2),
        speakers=torch.randint(1, speakers + 1, (size,)),
    )


def main() -> None:
    """Measure warm-up and adversarial steps; print a table and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--steps", type=int, default=6, help="timed steps of each order")
    parser.add_argument("--words", type=int, default=20_000)
    parser.add_argument("--speakers", type=int, default=1_400)
    parser.add_argument("--accelerator", default="cpu")
    arguments = parser.parse_args()
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    torch.manual_seed(0)
    facts = {
        "words": ["<PAD>", "<SOS>", "<EOS>", "<UNK>", *map(str, range(arguments.words - 4))],
        "speakers": [f"speaker{i}" for i in range(arguments.speakers)],
        "mean_direction": [0.0] * 27,
        "bone_lengths": [0.2] * 9,
    }
    method = Alternating(corpus=facts)  # type: ignore[arg-type]
    batch = random_batch(arguments.batch, arguments.words, arguments.speakers)
    result: dict[str, object] = {
        "batch": arguments.batch,
        "threads": torch.get_num_threads(),
        "torch": torch.__version__,
    }
    rows = []
    for phase, epoch in (("warm-up", 0), ("adversarial", 11)):
        method.epoch = epoch
        method.record()
        trainer = Trainer(
            accelerator=arguments.accelerator,
            devices=1,
            max_epochs=1,
            logger=False,
            enable_checkpointing=False,
            enable_progress_bar=False,
            enable_model_summary=False,
        )
        batches: Any = [batch] * (2 * arguments.steps + 2)
        trainer.fit(method, DataLoader(batches, batch_size=None, collate_fn=lambda item: item))
        limit = matmul_rate(arguments.batch, trainer.strategy.root_device)
        # The fastest step: other programs on the machine only ever add time.
        best = {order: min(seconds) for order, seconds in method.seconds.items()}
        for order, seconds in best.items():
            work = method.flops[order]
            rate = work / seconds
            rows.append(
                f"{phase:12} {order:10} {seconds:9.3f} {work / 1e9:9.0f} {rate / 1e9:9.0f}"
                f" {rate / limit:9.0%} {best['published'] / seconds:9.2f}x"
            )
        result[phase] = {
            "seconds": best,
            "gflop": {order: work / 1e9 for order, work in method.flops.items()},
            "matmul_gflops": limit / 1e9,
            "ratio": best["published"] / best["shared"],
        }
    head = ("phase", "order", "s/step", "GFLOP", "GFLOP/s", "of matmul", "speed")
    print("{:12} {:10} {:>9} {:>9} {:>9} {:>9} {:>10}".format(*head))
    print("\n".join(rows))
    print(json.dumps(result))


if __name__ == "__main__":
    main()
