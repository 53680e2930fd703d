"""All networks of the training, with the statistics they share."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn

from cospeech.corpus.batch import GestureBatch
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes
from cospeech.methods.multi_adversary.adversaries import Settings, WindowAdversary, WindowSizes
from cospeech.methods.multi_adversary.networks import Generator
from cospeech.methods.multi_adversary.scales import ACOUSTICS, Scales
from cospeech.motion.gesture_joints import GestureJoints
from cospeech.motion.phases import PhaseMerge


class PhaseStudent(nn.Module):
    """The phase classifier while it is trained.

    Args:
        joints: The gesturing joints; the arms' are looked at.
        merge: The classes.
        pitch: Whether it reads the pitch.
        sizes: Layers; None takes ours for so many classes.
    """

    class_of: Tensor

    def __init__(
        self, joints: GestureJoints, merge: PhaseMerge, pitch: bool, sizes: PhaseSizes | None
    ) -> None:
        super().__init__()
        self.arms, self.merge = list(joints.arms), merge
        self.roles = [joints.roles[i] for i in joints.arms]
        self.features = PhaseFeatures(len(self.arms), pitch)
        self.network = PhaseNetwork(self.features.channels, len(merge.classes), sizes)
        self.register_buffer("class_of", torch.tensor(merge.class_of))

    def loss(self, batch: GestureBatch, shift: int, run: int) -> tuple[Tensor, Tensor]:
        """Cross entropy and share of right steps on windows that begin ``shift`` steps later.

        Steps that nobody annotated are passed over; without any other the loss is 0.

        Args:
            batch: Joints, acoustics and phases.
            shift: From 0 to a window's length less one.
            run: Consecutive windows in the batch; with a shift, the last of each run is left out.
        """
        fields = (batch.require(name) for name in ("joints", "acoustics", "phases"))
        joints, acoustics, phases = (shifted(values, shift, run) for values in fields)
        scores = self.network(self.features(joints[..., self.arms, :], acoustics[..., -1]))
        known = phases[:, 1:] >= 0
        if not known.any():
            return 0 * scores.sum(), scores.new_zeros(())
        labels = self.class_of[phases[:, 1:][known]]
        found = self.network.probabilities(scores).argmax(dim=-1)[known]
        # One row of steps: the mean is over steps, whichever windows they are of.
        loss = self.network.loss(scores[known][None], labels[None])
        return loss, (found == labels).float().mean()

    def frozen(self) -> FrozenPhaseClassifier:
        """The classifier as it is now; further training doesn't change it."""
        return FrozenPhaseClassifier(
            self.network, self.features, self.merge.name, "arms", self.roles
        )


def shifted(values: Tensor, shift: int, run: int) -> Tensor:
    """Windows that begin later, cut from the same runs.

    Args:
        values: ``(B, T, ...)``; every ``run`` windows are consecutive.
        shift: Steps.
        run: Windows per run.

    Returns:
        ``(B / run * (run - 1), T, ...)``, or ``values`` where there is no shift.
    """
    if not shift:
        return values
    frames = values.shape[1]
    runs = values.unflatten(0, (-1, run)).flatten(1, 2)
    kept = runs[:, shift : shift + (run - 1) * frames]
    return kept.unflatten(1, (run - 1, frames)).flatten(0, 1)


class Players(nn.Module):
    """Generators, adversaries, the classifier in training, and the scales of what they see.

    Each network's first weights depend on the seed and its own name alone: leaving an adversary out
    changes no other network, so ablations start alike and can share products.

    Args:
        joints: The gesturing joints.
        adversaries: The settings of those that play.
        hidden_size: Of the generators.
        frames: Steps per window.
        merge: Classes of the phases.
        student: Whether a classifier is to be trained.
        pitch: Whether that classifier reads the pitch.
        sizes: Its layers; None takes ours.
        seed: Of the first weights.
    """

    def __init__(
        self,
        joints: GestureJoints,
        adversaries: Settings,
        hidden_size: int,
        frames: int,
        merge: PhaseMerge,
        student: bool,
        pitch: bool,
        sizes: PhaseSizes | None,
        seed: int,
    ) -> None:
        super().__init__()
        outputs = 3 * len(joints.roles)
        self.scales = Scales(joints)
        self.displacements = PhaseFeatures(len(joints.arms), pitch=False)
        with _own_seed(seed, "generator"):
            self.generator = Generator(ACOUSTICS, outputs, hidden_size)
        self.student: PhaseStudent | None = None
        if student:
            with _own_seed(seed, "classifier"):
                self.student = PhaseStudent(joints, merge, pitch, sizes)
        self.rehearsal: Generator | None = None
        if "motion" in adversaries:
            # The motion adversary's pre-training has a generator of its own (section 6.2).
            with _own_seed(seed, "rehearsal"):
                self.rehearsal = Generator(ACOUSTICS, outputs, hidden_size)
        built = nn.ModuleDict()
        window = WindowSizes(frames, len(joints.roles), len(joints.arms), len(merge.classes))
        for name, settings in adversaries.items():
            with _own_seed(seed, name):
                built[name] = settings.build(window)
        self._adversaries = built

    @property
    def adversaries(self) -> dict[str, WindowAdversary]:
        """By name."""
        return {
            name: player
            for name, player in self._adversaries.items()
            if isinstance(player, WindowAdversary)
        }

    def set_dropout(self, dense: float, recurrent: float) -> None:
        """Of the generators."""
        self.generator.set_dropout(dense, recurrent)
        if self.rehearsal is not None:
            self.rehearsal.set_dropout(dense, recurrent)

    def fit_scales(self, batches: Iterable[GestureBatch], arms: list[int]) -> None:
        """Take every statistic of the training part.

        Args:
            batches: Gone through several times; no iterator.
            arms: Indices of the arms' joints.
        """
        self.scales.fit(batches)
        self.displacements.fit((batch.require("joints")[..., arms, :], None) for batch in batches)
        if self.student is not None:
            self.student.features.fit(
                (batch.require("joints")[..., arms, :], batch.require("acoustics")[..., -1])
                for batch in batches
            )


@contextmanager
def _own_seed(seed: int, name: str) -> Iterator[None]:
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int.from_bytes(digest[:7], "big"))
        yield
