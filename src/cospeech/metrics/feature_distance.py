"""Distance of paired windows in the encoder's feature space, over batches."""

from __future__ import annotations

import torch
from torch import Tensor
from torchmetrics import Metric

from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.functional import feature_distance


class FeatureDistance(Metric):
    """Mean L1 distance, summed over dimensions, of paired windows' features.

    See docs/facts/trimodal.md, section 4.2.

    Unlike the Fréchet distance it asks for *this* window's motion, so it sees mismatched speech.

    Args:
        encoder: Makes the features; held outside the module tree, as the Fréchet distance does.
    """

    is_differentiable = False
    higher_is_better = False
    full_state_update = False
    plot_lower_bound = 0.0

    distance: Tensor
    count: Tensor

    def __init__(self, encoder: GestureEncoder) -> None:
        super().__init__()
        # In a tuple, because an attribute that is a module would be registered as a child.
        self._held_encoder = (encoder,)
        self.add_state("distance", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("count", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")

    @property
    def encoder(self) -> GestureEncoder:
        """The frozen encoder."""
        return self._held_encoder[0]

    @torch.no_grad()
    def update(self, generated: Tensor, real: Tensor) -> None:
        """Add paired windows ``(B, 34, 10, 3)``, root-relative, house axes, metres."""
        encoder = self.encoder.to(generated.device)
        features = encoder.encode_positions(generated), encoder.encode_positions(real)
        self.distance = self.distance + feature_distance(*features) * len(generated)
        self.count = self.count + len(generated)

    def compute(self) -> Tensor:
        """In the encoder's own unit, a float64 scalar."""
        return self.distance / self.count
