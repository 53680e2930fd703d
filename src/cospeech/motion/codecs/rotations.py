"""What codecs of joint rotations share: which joints are coded, and the way back to positions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise

import torch
from scipy.spatial.transform import Rotation
from torch import Tensor, nn

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import bare_names
from cospeech.motion.kinematics import joint_levels
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

# Entry by entry, row after row: 1 or 0, and the two products of components that are added to it.
_FIRST, _SECOND = [5, 1, 2, 1, 0, 6, 2, 6, 0], [10, 11, 7, 11, 10, 3, 7, 3, 5]
_OF_PRODUCTS = (
    [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    [-1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, -1.0],
)


def matrices_of_quaternions(quaternions: Tensor) -> Tensor:
    """Rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``, scalar last."""
    products = 2 * quaternions[..., :, None] * quaternions[..., None, :]
    identity, first, second = (torch.tensor(part).to(quaternions) for part in _OF_PRODUCTS)
    products = products.flatten(-2)
    entries = identity + products[..., _FIRST] * first + products[..., _SECOND] * second
    return entries.unflatten(-1, (3, 3))


def _levels(skeleton: Skeleton) -> list[tuple[Tensor, Tensor]]:
    """Joints by their distance from the root, and where their parents are in the level before."""
    levels = joint_levels(skeleton.parents)
    parents = [
        [above.index(skeleton.parents[joint]) for joint in joints]
        for above, joints in pairwise(levels)
    ]
    pairs = zip(levels, [[], *parents], strict=True)
    return [(torch.tensor(joints), torch.tensor(places).long()) for joints, places in pairs]


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
        self._levels = _levels(skeleton)
        self._place_by_level = torch.cat([joints for joints, _ in self._levels]).argsort()
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

    def _quaternions(self, features: Tensor) -> Tensor:
        """Unit quaternions ``(..., C, 4)`` of `_features`."""
        matrices = self._matrices(features).double().cpu()
        turns = Rotation.from_matrix(matrices.reshape(-1, 3, 3).numpy())
        return torch.from_numpy(turns.as_quat()).view(*matrices.shape[:-2], 4)

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
        coded = self._matrices(self._by_joint(features))
        return self._every_joint(coded, matrices_of_quaternions(self.others))

    def _by_joint(self, features: Tensor) -> Tensor:
        return features.unflatten(-1, (len(self.joints), self.values_per_joint))

    def _every_joint(self, coded: Tensor, others: Tensor) -> Tensor:
        """``(..., J, *rotation)`` of ``(..., C, *rotation)`` coded ones and ``(J, *rotation)``."""
        joint_dim = coded.dim() - others.dim()
        others = others.to(coded).expand(*coded.shape[:joint_dim], *others.shape)
        sources = list(range(len(self.joints), len(self.joints) + len(self.skeleton)))
        for column, joint in zip(self._columns, self._indices, strict=True):
            sources[joint] = column
        index = torch.tensor(sources, device=coded.device)
        return torch.cat([coded, others], dim=joint_dim).index_select(joint_dim, index)

    def decode(self, features: Tensor, root_positions: Tensor | None = None) -> Tensor:
        """Positions ``(..., J, 3)`` in metres of features ``(..., size)``.

        Args:
            features: Network output or `encode`'s result.
            root_positions: ``(..., 3)`` metres; roots at their rest offset when None.
        """
        return self._posed(self.decode_rotations(features), root_positions)

    def _posed(self, local: Tensor, root_positions: Tensor | None) -> Tensor:
        """Positions ``(..., J, 3)`` of local rotation matrices ``(..., J, 3, 3)``."""
        offsets, (roots, _) = self.offsets.to(local.dtype), self._levels[0]
        places = offsets[roots] if root_positions is None else root_positions[..., None, :]
        positions = [places.expand(*local.shape[:-3], len(roots), 3)]
        world = local[..., roots, :, :]
        for joints, above in self._levels[1:]:
            turns = world[..., above, :, :]
            bones = (turns @ offsets[joints, :, None]).squeeze(-1)
            positions.append(positions[-1][..., above, :] + bones)
            world = turns @ local[..., joints, :, :]
        return torch.cat(positions, dim=-2)[..., self._place_by_level, :]

    @torch.no_grad()
    def motion(self, features: Tensor, fps: float, root_positions: Tensor | None = None) -> Motion:
        """The whole skeleton's motion, rotations included.

        Args:
            features: ``(T, size)``.
            fps: Frames per second.
            root_positions: ``(T, 3)``, as for `decode`.
        """
        if features.dtype in (torch.float16, torch.bfloat16):
            features = features.float()  # half of the digits don't make unit quaternions
        local = self.decode_rotations(features)
        rotations = self._every_joint(self._quaternions(self._by_joint(features)), self.others)
        return Motion(
            self.skeleton,
            fps,
            self._posed(local, root_positions).float().cpu().numpy(),
            rotations.float().cpu().numpy(),
        )
