"""A trained phase classifier, frozen: for other networks' losses, and for labelling recordings."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal, TypedDict, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import parse_json, understood
from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes
from cospeech.judges.phase_classifier.step_sequences import centred, step_sequences
from cospeech.motion.gesture_joints import GestureJoints, gesture_joints
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASE_MERGES, PhaseMerge
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import BodyJoints, wrists
from cospeech.nn.weights_file import filled, read_weights, write_weights
from cospeech.speech.speech import Speech

WINDOW_FRAMES = 100
"""Positions per window, 5 s; one velocity fewer."""

JointSet = Literal["arms", "wrists"]
"""``"arms"``: shoulders, elbows, wrists and finger tips, seen from the pelvis. ``"wrists"``: both
wrists, seen from the spine; for data that has no more."""

WRIST_ROLES = ("left_wrist", "right_wrist")

FORMAT = "cospeech.phase_classifier"
_WHAT = "a phase classifier"
_TRAIN_ONE = (
    "give the phase_classifier.pt in the folder of a run of model=phase_classifier; python train.py"
    " model=phase_classifier trains one"
)


class PhaseClassifierDescription(TypedDict):
    """What a `FrozenPhaseClassifier` is made of, but for its numbers; plain values.

    Attributes:
        merge: Name of its classes in `PHASE_MERGES`.
        joint_set: Which joints it looks at, and from where.
        roles: The joints, in order, named as in `GestureJoints.roles`.
        pitch: Of `PhaseFeatures`, as the next two.
        speeds: Whether speeds are channels.
        smooth: Whether positions pass a low-pass.
        sizes: Of `PhaseSizes`.
    """

    merge: str
    joint_set: JointSet
    roles: list[str]
    pitch: bool
    speeds: bool
    smooth: bool
    sizes: dict[str, float]


class FrozenPhaseClassifier(nn.Module):
    """Network, statistics, classes and joints of a trained phase classifier.

    No call changes it: its weights take no gradient, dropout is off and the batch norm uses its
    running statistics, in training as in evaluation. Gradients do flow *through* it, to the joints
    (docs/facts/multi_adversary.md, section 7, trap 2).

    Args:
        network: Copied; further training of it changes nothing here.
        features: With the statistics of the training part; copied.
        merge: Name of the classes in `PHASE_MERGES`.
        joint_set: Which joints it looks at, and from where.
        roles: The joints in the features' order.

    Raises:
        ValueError: The parts don't fit one another.
    """

    def __init__(
        self,
        network: PhaseNetwork,
        features: PhaseFeatures,
        merge: str,
        joint_set: JointSet,
        roles: Sequence[str],
    ) -> None:
        super().__init__()
        self.merge: PhaseMerge = PHASE_MERGES[merge]
        if (network.inputs, network.classes) != (features.channels, len(self.merge.classes)):
            raise ValueError(
                f"a network of {network.inputs} inputs and {network.classes} classes, for"
                f" {features.channels} channels and the classes {self.merge.classes}"
            )
        if features.joints != len(roles):
            raise ValueError(f"features of {features.joints} joints, for {roles}")
        self.joint_set: JointSet = joint_set
        self.roles = tuple(roles)
        self.network = copy.deepcopy(network)
        self.features = copy.deepcopy(features)
        self.requires_grad_(False)
        self.train(False)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes."""
        return self.merge.classes

    @property
    def pitch(self) -> bool:
        """Whether it reads the pitch."""
        return self.features.pitch

    def train(self, mode: bool = True) -> FrozenPhaseClassifier:
        """Stays as it is, whatever the mode.

        The LSTMs, which have no dropout of their own, are in training mode: cuDNN gives no
        gradients in the other.
        """
        super().train(False)
        for module in self.modules():
            if isinstance(module, nn.LSTM):
                module.train(True)
        return self

    def choose(self, joints: Tensor, layout: GestureJoints) -> Tensor:
        """The classifier's joints among the gesturing joints of a method; differentiable.

        Args:
            joints: ``(B, T, J', 3)`` in the order of ``layout.roles``, body frame, metres.
            layout: From `gesture_joints` of the corpus's skeleton.

        Returns:
            ``(B, T, J, 3)`` for `class_probabilities`.

        Raises:
            CospeechError: Some are missing; the message names them.
        """
        chosen = joints[..., self._indices(layout.roles), :]
        if self.joint_set == "wrists":
            spine = layout.evaluation_spine
            return chosen - joints[..., spine : spine + 1, :]
        return chosen

    def class_probabilities(self, joints: Tensor, pitch: Tensor | None = None) -> Tensor:
        """Probability of each class at every step but the first; differentiable in ``joints``.

        Args:
            joints: ``(B, T, J, 3)`` of the classifier's joints (see `choose`) in the body frame at
                20 fps, metres.
            pitch: ``(B, T)`` F0, Hz, 0 where unvoiced; unused by a classifier without pitch.

        Returns:
            ``(B, T - 1, K)``, K as `classes`; step t goes with frame t + 1.

        Raises:
            ValueError: Another number of joints, or the pitch is missing.
        """
        return self.network.probabilities(self.network(self.features(joints, pitch)))

    @torch.no_grad()
    def step_probabilities(
        self, joints: NDArray[np.float32], pitch: NDArray[np.float32] | None
    ) -> NDArray[np.float32]:
        """As `class_probabilities`, of one sequence of any length.

        Windows of 5 s overlap, and only the middle of each counts.

        Args:
            joints: ``(T, J, 3)``, T >= 2, otherwise as there.
            pitch: ``(T,)``; None for a classifier without pitch.

        Returns:
            ``(T - 1, K)``.
        """
        windows, keep = centred(len(joints), WINDOW_FRAMES)
        rows, device = torch.from_numpy(windows), self.features.mean.device
        scores = self.class_probabilities(
            torch.from_numpy(joints)[rows].to(device),
            torch.from_numpy(pitch)[rows].to(device) if self.pitch and pitch is not None else None,
        )
        chosen: NDArray[np.float32] = scores.cpu().numpy()[keep]
        return chosen

    @torch.no_grad()
    def probabilities(self, motion: Motion, speech: Speech | None = None) -> NDArray[np.float32]:
        """Class probabilities of every frame of a recording of any length.

        All interleaved sequences of 20 fps are classified, in windows of 5 s of which only the
        middle counts; a frame has the probabilities of the step nearest in time.

        Args:
            motion: At any frame rate, world space or root-relative.
            speech: Of the same time; unused by a classifier without pitch.

        Returns:
            ``(frames, K)``, K as `classes`.

        Raises:
            CospeechError: The skeleton lacks a joint, there is no speech to take the pitch from, or
                the motion is shorter than two steps.
        """
        body = self._body_joints(motion.skeleton)
        sequences = step_sequences(motion, body, speech if self.pitch else None)
        if self.pitch and speech is None:
            raise CospeechError(
                "this classifier reads the pitch, and there is no speech",
                "give the audio too, or use a classifier trained with model.pitch=false",
            )
        found = [
            self.step_probabilities(joints, hertz)
            for joints, hertz in zip(sequences.joints, sequences.pitch, strict=True)
        ]
        return sequences.placed(found, len(motion), motion.fps)

    def label(self, motion: Motion, speech: Speech | None = None) -> NDArray[np.int64]:
        """The likeliest class of every frame of a recording of any length.

        Args:
            motion: As in `probabilities`.
            speech: As in `probabilities`.

        Returns:
            ``(frames,)`` indices into `classes`.

        Raises:
            CospeechError: As `probabilities`.
        """
        return self.probabilities(motion, speech).argmax(axis=1)

    def describe(self) -> PhaseClassifierDescription:
        """Plain values from which `build` makes one of the same shape."""
        return {
            "merge": self.merge.name,
            "joint_set": self.joint_set,
            "roles": list(self.roles),
            "pitch": self.pitch,
            "speeds": self.features.speeds,
            "smooth": self.features.smooth,
            "sizes": asdict(self.network.sizes),
        }

    @classmethod
    def build(cls, description: PhaseClassifierDescription) -> FrozenPhaseClassifier:
        """An untrained classifier of the described shape, for `load_state_dict`.

        Raises:
            KeyError: The description names classes that don't exist, or lacks a value.
            ValueError: Its parts don't fit one another.
        """
        merge = PHASE_MERGES[description["merge"]]
        features = PhaseFeatures(
            len(description["roles"]),
            description["pitch"],
            description["speeds"],
            description["smooth"],
        )
        sizes = PhaseSizes(**description["sizes"])  # type: ignore[arg-type]
        network = PhaseNetwork(features.channels, len(merge.classes), sizes)
        joint_set, roles = description["joint_set"], description["roles"]
        if joint_set not in get_args(JointSet):
            raise ValueError(f"there is no set of joints called {joint_set!r:.50}")
        return cls(network, features, merge.name, joint_set, roles)

    @classmethod
    def restored(
        cls, description: PhaseClassifierDescription, state: Mapping[str, Tensor]
    ) -> FrozenPhaseClassifier:
        """A classifier with its numbers; memory is taken only for what the state has.

        Raises:
            KeyError: As `build`.
            ValueError: As `build`, or the state is of another shape.
        """
        return filled(lambda: cls.build(description), state)

    def save(self, path: str | Path) -> None:
        """Write it as plain tensors and values; the file appears only when complete.

        Args:
            path: File to write; an existing one is replaced.
        """
        state = {name: tensor.cpu() for name, tensor in self.state_dict().items()}
        description = json.dumps(self.describe())
        write_weights(path, {"format": FORMAT, "description": description, "state": state})

    @classmethod
    def load(cls, path: str | Path) -> FrozenPhaseClassifier:
        """Read what `save` wrote, on the CPU.

        Raises:
            InputFileError: Missing, unsafe to read, damaged, or something else.
        """
        path = Path(path)
        content = read_weights(path, _TRAIN_ONE)
        if content.get("format") != FORMAT:
            raise InputFileError(path, _what_it_is(content), hint=_TRAIN_ONE)
        with understood(path, _WHAT, _TRAIN_ONE):
            description = parse_json(path, content["description"], _WHAT, _TRAIN_ONE)
            return cls.restored(description, content["state"])

    def _body_joints(self, skeleton: Skeleton) -> BodyJoints:
        if self.joint_set == "wrists":
            return wrists(skeleton)
        layout = gesture_joints(skeleton)
        names = tuple(layout.body.joints[i] for i in self._indices(layout.roles))
        return BodyJoints(names, layout.body.reference, layout.body.sideways)

    def _indices(self, roles: Sequence[str]) -> list[int]:
        if missing := [role for role in self.roles if role not in roles]:
            raise CospeechError(
                f"the phase classifier looks at {', '.join(missing)}, which this skeleton lacks",
                "use a classifier trained on a corpus with the same joints, or on wrists alone"
                " (model.joints=wrists)",
            )
        return [roles.index(role) for role in self.roles]


def _what_it_is(content: Mapping[str, object]) -> str:
    """A file of tensors that is given in the place of a phase classifier."""
    found = "not a phase classifier"
    if "state_dict" in content:
        return f"{found} but the checkpoint of a training"
    if "stage" in content:
        return f"{found} but what the stage {content['stage']!s:.30} of a training left"
    kind = content.get("format")
    return f"{found} but a file of the kind {kind:.60}" if isinstance(kind, str) else found
