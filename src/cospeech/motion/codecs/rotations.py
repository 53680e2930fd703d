"""What codecs of joint rotations share: which joints are coded, and the way back to positions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor, nn

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import bare_names
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton


def matrices_of_quaternions(quaternions: Tensor) -> Tensor:
    """Rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``, scalar last."""
    x, y, z, w = quaternions.unbind(-1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


class RotationCodec(nn.Module, ABC):
    """Local rotations of some joints of a skeleton, a fixed number of values a joint.

    The order of the features is that of ``joints``. Joints that are not coded keep one rotation:
    none (the rest pose) until `fit`. It and the bones are buffers, so a checkpoint of a codec on
    the same joints is enough to speak.

    Args:
        skeleton: With rest offsets; the bones that `decode` poses. A recording's own are those of
            the skeleton of its motion.
        joints: Names of the joints that are coded, prefixes (``mixamorig:``) apart. One that the
            skeleton lacks, by its name or said to be None, is at rest: zeros when its rotation is
            encoded as a vector, and of no effect when it is decoded, so that a model's channels fit
            skeletons with fewer joints.

    Raises:
        CospeechError: The skeleton has no rest offsets, or none of the joints.
    """

    values_per_joint: int
    offsets: Tensor
    others: Tensor

    def __init__(self, skeleton: Skeleton, joints: Sequence[str | None]) -> None:
        super().__init__()
        names = bare_names(skeleton)
        wanted = [(i, joint) for i, joint in enumerate(joints) if joint is not None]
        known = [(i, names[joint]) for i, joint in wanted if joint in names]
        if skeleton.offsets is None or not known:
            lacks = ", ".join(joint for _, joint in wanted)
            lacks = "rest offsets" if skeleton.offsets is None else lacks
            raise CospeechError(
                f"rotations can't pose skeleton {skeleton.name!r}, which has no {lacks}",
                "use a corpus of BVH files, or the embedded one",
            )
        self.skeleton = skeleton
        self.joints = tuple(joints)
        self._columns = [column for column, _ in known]
        self._indices = [index for _, index in known]
        self.register_buffer("offsets", torch.tensor(skeleton.offsets, dtype=torch.float32))
        self.register_buffer("others", torch.tensor([0.0, 0.0, 0.0, 1.0]).repeat(len(skeleton), 1))

    @property
    def size(self) -> int:
        """Values a frame."""
        return self.values_per_joint * len(self.joints)

    @abstractmethod
    def _features(self, quaternions: Tensor) -> Tensor:
        """``(..., T, C, values_per_joint)`` of unit quaternions ``(..., T, C, 4)``."""

    @abstractmethod
    def _matrices(self, features: Tensor) -> Tensor:
        """Rotation matrices ``(..., C, 3, 3)`` of `_features`."""

    @torch.no_grad()
    def fit(self, rotations_local: Tensor) -> None:
        """Take the mean rotation of every joint, for those that are not coded.

        Args:
            rotations_local: ``(T, J, 4)`` unit quaternions of training motion.
        """
        for joint in range(len(self.skeleton)):
            mean = Rotation.from_quat(rotations_local[:, joint].double().cpu().numpy()).mean()
            self.others[joint] = torch.from_numpy(mean.as_quat()).to(self.others)

    def encode(self, rotations_local: Tensor) -> Tensor:
        """Features ``(..., T, size)`` of unit quaternions ``(..., T, J, 4)``, scalar last."""
        rest = torch.zeros_like(rotations_local[..., :1, :])
        rest[..., 3] = 1
        coded = torch.cat([rotations_local, rest], dim=-2)
        index = [len(self.skeleton)] * len(self.joints)
        for column, joint in zip(self._columns, self._indices, strict=True):
            index[column] = joint
        return self._features(coded[..., index, :]).flatten(-2)

    def decode_rotations(self, features: Tensor) -> Tensor:
        """Local rotation matrices ``(..., J, 3, 3)`` of every joint."""
        coded = self._matrices(features.unflatten(-1, (len(self.joints), self.values_per_joint)))
        others = matrices_of_quaternions(self.others).to(features.dtype)
        matrices = list(others.expand(*features.shape[:-1], -1, -1, -1).unbind(-3))
        for column, joint in zip(self._columns, self._indices, strict=True):
            matrices[joint] = coded[..., column, :, :]
        return torch.stack(matrices, dim=-3)

    def decode(self, features: Tensor, root_positions: Tensor | None = None) -> Tensor:
        """Positions ``(..., J, 3)`` in metres of features ``(..., size)``.

        Args:
            features: Network output or `encode`'s result.
            root_positions: ``(..., 3)`` metres; roots at their rest offset when None.
        """
        world: list[Tensor] = []
        positions: list[Tensor] = []
        local = self.decode_rotations(features)
        for joint, parent in enumerate(self.skeleton.parents):
            turn, offset = local[..., joint, :, :], self.offsets[joint]
            if parent < 0:
                place = offset.expand(*features.shape[:-1], 3).to(local.dtype)
                positions.append(place if root_positions is None else root_positions)
                world.append(turn)
                continue
            positions.append(positions[parent] + world[parent] @ offset.to(local.dtype))
            world.append(world[parent] @ turn)
        return torch.stack(positions, dim=-2)

    @torch.no_grad()
    def motion(self, features: Tensor, fps: float, root_positions: Tensor | None = None) -> Motion:
        """The whole skeleton's motion, rotations included.

        Args:
            features: ``(T, size)``.
            fps: Frames per second.
            root_positions: ``(T, 3)``, as for `decode`.
        """
        matrices = self.decode_rotations(features).double().cpu().numpy()
        rotations: NDArray[np.float64] = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat()
        return Motion(
            self.skeleton,
            fps,
            self.decode(features, root_positions).float().cpu().numpy(),
            rotations.reshape(*matrices.shape[:2], 4).astype(np.float32),
        )
