"""Rotations by the principal components of another codec's features."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cospeech.motion.codecs.rotations import RotationCodec
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton


class PrincipalComponentCodec(nn.Module):
    """The first principal components of a codec's features, not scaled.

    Mean and directions are buffers, so a checkpoint is enough to speak. Until `fit` the components
    are the first features themselves, so that a new model can be tried out.

    Args:
        codec: Gives the features, and takes them back.
        components: How many, at most ``codec.size``.
    """

    mean: Tensor
    directions: Tensor
    variance_kept: Tensor

    def __init__(self, codec: RotationCodec, components: int) -> None:
        super().__init__()
        if not 1 <= components <= codec.size:
            raise ValueError(f"{codec.size} features have 1 to {codec.size} components")
        self.features = codec
        self.register_buffer("mean", torch.zeros(codec.size))
        self.register_buffer("directions", torch.eye(codec.size)[:components].clone())
        self.register_buffer("variance_kept", torch.zeros(()))

    @property
    def size(self) -> int:
        """Values a frame."""
        return len(self.directions)

    @property
    def skeleton(self) -> Skeleton:
        """The codec's, whose bones are posed."""
        return self.features.skeleton

    @property
    def joints(self) -> tuple[str | None, ...]:
        """The codec's coded joints."""
        return self.features.joints

    @torch.no_grad()
    def fit(self, rotations_local: Tensor) -> None:
        """Take mean and directions of training motion, and what of its variance they keep (0 to 1).

        The same motion gives the same directions: of each, the largest number is positive.

        Args:
            rotations_local: ``(T, J, 4)`` unit quaternions.
        """
        self.features.fit(rotations_local)
        values = self.features.encode(rotations_local).double().cpu()
        mean = values.mean(dim=0)
        centred = values - mean
        variances, vectors = torch.linalg.eigh(centred.T @ centred / len(values))
        # Ascending, one a column.
        directions = vectors.flip(1).T[: self.size]
        largest = directions.gather(1, directions.abs().argmax(dim=1, keepdim=True))
        self.mean.copy_(mean)
        self.directions.copy_(directions * largest.sign())
        total = variances.sum()
        kept = variances[-self.size :].sum() / total if total > 0 else torch.ones(())
        self.variance_kept.copy_(kept)

    def encode(self, rotations_local: Tensor) -> Tensor:
        """Components ``(..., T, size)`` of unit quaternions ``(..., T, J, 4)``, scalar last."""
        return (self.features.encode(rotations_local) - self.mean) @ self.directions.T

    def motion(self, components: Tensor, fps: float) -> Motion:
        """The whole skeleton's motion of components ``(T, size)``; see `RotationCodec.motion`.

        A frame is the same to the bit whatever the others are, and however many.
        """
        # A matrix product's bits depend on the number of frames; those of sums of products don't.
        features = self.mean.expand(*components.shape[:-1], -1)
        for score, direction in zip(components.unbind(-1), self.directions, strict=True):
            features = features + score[..., None] * direction
        return self.features.motion(features, fps)
