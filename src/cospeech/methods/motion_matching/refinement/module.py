"""Refining matched motion by a conditional GAN, with manual optimisation."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
import torch
from lightning.pytorch.core.optimizer import LightningOptimizer
from numpy.typing import NDArray
from torch import Tensor

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import ON_SCORES, chosen_losses
from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.features.cepstra import CEPSTRA
from cospeech.corpus.features.joints import pose_roles
from cospeech.corpus.store import Store
from cospeech.corpus.window_loader import WindowLoader
from cospeech.errors import ConfigError, CospeechError, require_choice, require_range
from cospeech.matching.control import Controls
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import database_folder
from cospeech.matching.reference import STEP_FRAMES, Preselect
from cospeech.matching.seams import Seam
from cospeech.matching.streaming import MatchedPieces
from cospeech.matching.synthesis import InitialPose, MatchingSettings
from cospeech.methods.motion_matching.matched import K_NN, MatchedMethod
from cospeech.methods.motion_matching.refinement.losses import (
    PenaltyPoints,
    gradient_penalty,
    reconstruction_loss,
)
from cospeech.methods.motion_matching.refinement.networks import Critic, Form, Refiner
from cospeech.methods.motion_matching.refinement.pair_windows import PairWindows, open_pair_windows
from cospeech.methods.motion_matching.refinement.pairs import PairSettings
from cospeech.methods.motion_matching.refinement.scales import Scales
from cospeech.methods.motion_matching.refinement.streaming import RefinedStream
from cospeech.methods.streams import Stream
from cospeech.motion.skeleton import Skeleton
from cospeech.nn.modes import evaluating
from cospeech.speech.feature_sets.sphinx import STATIC_CHANNELS
from cospeech.speech.speech import Speech
from cospeech.training.losses import WeighedLosses
from cospeech.training.stages import Progress, Schedule
from cospeech.training.staging import TrainsInStages
from cospeech.training.steps import descend, log_losses

REFINED = "k-NN + cGAN"
"""Name of the stage that is the refinement's output."""

SPEECH_CHANNELS = 2 * STATIC_CHANNELS
"""Cepstra, energy, and the changes of both."""


class RefinedMotionMatching(TrainsInStages, MatchedMethod):
    """k-NN search, then a cGAN that makes its output like real motion to the same speech.

    The first training step finds the database and the training pairs ready: they are made before,
    and kept beside the store. Defaults are the published code's (docs/facts/motion_matching.md,
    section 6), but for the selection of checkpoints.

    Logs, unweighted, ``train/critic`` (what the critic makes small: generated less real),
    ``train/penalty``, ``train/adversarial`` and ``train/reconstruction``.

    Args:
        corpus: Where the store is, its speakers and skeleton.
        preselect: See `cospeech.methods.motion_matching.MotionMatching`, as for the next seven.
        step_frames: Frames that each search adds.
        k: Which candidate is taken outside training, from 1.
        start_offset: 1 leaves out the frame that is like the one before.
        natural_continuation: Offer what goes on from the window before.
        initial_pose: ``"random"`` or ``"mean"``.
        seam: What happens between matched windows before they are refined.
        true_future: See `MatchingSpec`.
        chunk_frames: Length of the database's sequences.
        same_speaker: Use the motion of one speaker at a time, in training pairs as well.
        database: Folder of a database, in place of the corpus's own.
        form: The generator, as in the published ``"code"`` or as in the ``"paper"``.
        residual: Let it put out what is added to the matched poses.
        generator_width: Channels of its first convolutions.
        critic_width: Channels of the critic's first convolutions.
        reconstruction_weight: Of the distance from what was matched.
        adversarial_weight: Of the critic's verdict.
        adversarial_loss: Name among `cospeech.adversarial.losses.ON_SCORES`.
        penalty_weight: Of the gradient penalty.
        penalty_at: ``"interpolates"``, or ``"generated"`` as equation 2 is printed.
        critic_updates: Length of the training (the published 300,000 iterations).
        critic_updates_per_generator: Critic updates for each of the generator's.
        learning_rate: Adam's, of both.
        betas: Adam's, of both.
        weight_decay: Adam's, of both.
        averaging: Decay of the generator's running average, which is what is judged and speaks; 0
            takes the last weights.
        pair_stride: Frames from one training window's start to the next.
        first_candidate_only: Match every training window's best candidate, not half of them the
            second to fifteenth.
        exclude_own: Close a training window's own neighbourhood in the database to it.
        pairs_seed: Of the pairs; apart from the run's, so that runs share them.

    Raises:
        ConfigError: A value that is out of its range or not among the choices.
    """

    needs = frozenset({"poses", "matched", "cepstra", "speakers"})
    derived_from = frozenset({"fgd"})

    def __init__(
        self,
        corpus: CorpusFacts,
        preselect: Preselect = "pose",
        step_frames: int = STEP_FRAMES,
        k: int = 1,
        start_offset: int = 0,
        natural_continuation: bool = False,
        initial_pose: InitialPose = "random",
        seam: Seam = "cut",
        true_future: bool = False,
        chunk_frames: int = 64,
        same_speaker: bool = True,
        database: str | None = None,
        form: Form = "code",
        residual: bool = False,
        generator_width: int = 128,
        critic_width: int = 512,
        reconstruction_weight: float = 0.1,
        adversarial_weight: float = 1.0,
        adversarial_loss: str = "wasserstein",
        penalty_weight: float = 100.0,
        penalty_at: PenaltyPoints = "interpolates",
        critic_updates: int = 300_000,
        critic_updates_per_generator: int = 5,
        learning_rate: float = 1e-4,
        betas: tuple[float, float] = (0.0, 0.9),
        weight_decay: float = 4e-5,
        averaging: float = 0.999,
        pair_stride: int = 5,
        first_candidate_only: bool = False,
        exclude_own: bool = True,
        pairs_seed: int = 0,
    ) -> None:
        super().__init__(
            corpus,
            MatchingSpec(chunk_frames=chunk_frames, true_future=true_future),
            MatchingSettings(
                preselect,
                step_frames,
                k,
                start_offset,
                natural_continuation,
                initial_pose,
                seam,
            ),
            same_speaker,
            database,
        )
        for name, value, least in (
            ("critic_updates", critic_updates, 1),
            ("generator_width", generator_width, 1),
            ("pairs_seed", pairs_seed, 0),
            ("learning_rate", learning_rate, 0),
            ("critic_updates_per_generator", critic_updates_per_generator, 1),
            ("reconstruction_weight", reconstruction_weight, 0),
            ("adversarial_weight", adversarial_weight, 0),
            ("penalty_weight", penalty_weight, 0),
        ):
            require_range(f"model.{name}", value, least)
        require_choice("model.penalty_at", penalty_at, get_args(PenaltyPoints))
        if not 0 <= averaging < 1:
            raise ConfigError(f"model.averaging={averaging}: must be from 0 to below 1")
        self.save_hyperparameters(logger=False)
        self.pair_settings = PairSettings(
            frames=self.window.frames,
            stride=pair_stride,
            k=1 if first_candidate_only else None,
            closed_frames=self.window.frames if exclude_own else None,
            natural_continuation=natural_continuation,
            from_mean_pose=initial_pose == "mean",
        )
        self.pairs_seed = pairs_seed
        self.reconstruction_weight = reconstruction_weight
        self.penalty_weight, self.penalty_at = penalty_weight, penalty_at
        self.critic_updates_per_generator = critic_updates_per_generator
        self.learning_rate, self.betas, self.weight_decay = learning_rate, betas, weight_decay
        self.averaging = averaging
        self._roles = pose_roles(Skeleton.from_dict(corpus["skeleton"]))
        self.scales = Scales(self._roles, SPEECH_CHANNELS)
        numbers = 3 * len(self._roles)
        self.generator = Refiner(SPEECH_CHANNELS, numbers, generator_width, form, residual)
        self.averaged = copy.deepcopy(self.generator).requires_grad_(False)
        self.adversary = Adversary(
            Critic(SPEECH_CHANNELS + numbers, self.window.frames, critic_width),
            chosen_losses(adversarial_loss, ON_SCORES, "model.adversarial_loss"),
            weight=adversarial_weight,
            start_epoch=0,
        )
        self.schedule = Schedule(("refinement",), {"refinement": critic_updates})
        self.progress = Progress("refinement")

    def _open(self) -> MatchingDatabase:
        database = super()._open()
        if other := sorted({*database.pose_roles} ^ {*self._roles}):
            raise CospeechError(
                f"the matching database has other joints than the network: {', '.join(other)}",
                "fit it to a corpus with the network's skeleton",
            )
        return database

    # Training ------------------------------------------------------------------------------

    def windows(self, store: Store, split: str, needs: frozenset[str]) -> PairWindows:
        """Pairs of real and matched motion, made on first use."""
        folder = Path(self._folder or database_folder(store, self.spec)) / "pairs"
        return open_pair_windows(
            store,
            split,
            self.matcher.search,
            self.pair_settings,
            self.pairs_seed,
            needs,
            folder,
            self.matching.seam,
            self.same_speaker,
            self.matching.k,
        )

    def on_fit_start(self) -> None:
        """The database comes before the first step."""
        self.fit_to_corpus()

    def measure_corpus(self) -> dict[str, Any]:
        """Take the statistics of the training motion."""
        loader = self.trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        assert isinstance(loader.dataset, PairWindows)
        poses, cepstra = (loader.dataset.every_frame(name) for name in ("poses", "cepstra"))
        self.scales.fit(torch.from_numpy(poses), torch.from_numpy(cepstra))
        return {}

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for the generator, Adam for the critic."""
        return [
            torch.optim.Adam(
                network.parameters(),
                self.learning_rate,
                self.betas,
                weight_decay=self.weight_decay,
            )
            for network in (self.generator, self.adversary)
        ]

    def training_step(self, batch: GestureBatch, batch_idx: int) -> dict[str, Tensor]:
        """One critic update, and a generator update before every fifth.

        See docs/facts/motion_matching.md, section 6.
        """
        generator_optimizer, critic_optimizer = cast(list[LightningOptimizer], self.optimizers())
        speech = self.scales.speech(batch.require("cepstra"))
        real = self.scales.poses(batch.require("poses"))
        matched = self.scales.poses(batch.require("matched"))
        moves = self.progress.step % self.critic_updates_per_generator == 0
        with torch.set_grad_enabled(moves):
            refined = self.generator(speech, matched)
        heard_real = torch.cat([speech, real], dim=2)
        heard_refined = torch.cat([speech, refined], dim=2)
        critic, generator = WeighedLosses(), WeighedLosses()

        critic.add("critic", 1, self.adversary.own_loss, heard_real, heard_refined)
        if self.penalty_weight > 0:
            shown = (self.adversary.discriminator, heard_real, heard_refined, self.penalty_at)
            critic.add("penalty", self.penalty_weight, gradient_penalty, *shown)
        descend(self, critic_optimizer, critic.total)

        if moves:
            generator.add(
                "reconstruction", self.reconstruction_weight, reconstruction_loss, matched, refined
            )
            generator.add(
                "adversarial", self.adversary.weight, self.adversary.generator_loss, heard_refined
            )
            descend(self, generator_optimizer, generator.total)
            self._average()
        logged = log_losses(self, critic.values | generator.values, len(batch))
        self.finish_step()
        return logged

    @torch.no_grad()
    def _average(self) -> None:
        # Early on the average follows closely, or it would long remember the first weights.
        updates = self.progress.step // self.critic_updates_per_generator
        decay = min(self.averaging, (1 + updates) / (10 + updates))
        pairs = zip(self.averaged.parameters(), self.generator.parameters(), strict=True)
        for averaged, now in pairs:
            averaged.lerp_(now, 1 - decay)
        for average, current in zip(self.averaged.buffers(), self.generator.buffers(), strict=True):
            average.copy_(current)

    def derived_values(self, values: dict[str, Tensor]) -> dict[str, Tensor]:
        """The criterion that selects checkpoints: FGD times the seam's distance from 1, as ratio.

        Both are of held-out windows, and neither can be bought with the other
        (docs/facts/motion_matching.md, section 10, decision 11).
        """
        seam = self.seam()
        return {"selection": values["fgd"] * max(seam, 1 / max(seam, 1e-9))}

    @property
    def speaking(self) -> Refiner:
        """The generator that is judged and speaks."""
        return self.averaged if self.averaging else self.generator

    # Motion --------------------------------------------------------------------------------

    def stages(
        self,
        speech: Speech,
        controls: Controls | None,
        generator: torch.Generator,
        speaker: str | None = None,
    ) -> dict[str, NDArray[np.float32]]:
        """The search's output, and the same refined."""
        closed = self.closed_sequences(speaker, generator)
        matched = self.matcher(speech, controls, generator, closed).poses
        cepstra = CEPSTRA.of_speech(speech, self.window.fps, len(matched))
        return {
            K_NN: matched,
            REFINED: self._refined(matched, cepstra) if len(matched) else matched,
        }

    def stream(self, pieces: MatchedPieces) -> Stream:
        """The search's output, refined eight frames at a time."""
        network = self.speaking.piecewise()

        def refine(
            matched: NDArray[np.float32], cepstra: NDArray[np.float32], is_end: bool
        ) -> NDArray[np.float32]:
            poses, sound = (torch.from_numpy(v).to(self.device) for v in (matched, cepstra))
            refined = network(self.scales.speech(sound), self.scales.poses(poses), is_end)
            return self.scales.joints(refined).cpu().numpy()

        return RefinedStream(
            pieces, self.window.fps, self.speaking.behind, refine, self.upper_body_motion
        )

    def _refined(
        self, matched: NDArray[np.float32], cepstra: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        both = (torch.from_numpy(values)[None].to(self.device) for values in (matched, cepstra))
        return self._refine(*both)[0].cpu().numpy()

    def _sample_poses(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        return self._refine(batch.require("matched"), batch.require("cepstra"))

    @torch.no_grad()
    def _refine(self, poses: Tensor, cepstra: Tensor) -> Tensor:
        network = self.speaking
        with evaluating(network):
            refined = network(self.scales.speech(cepstra), self.scales.poses(poses))
        return self.scales.joints(refined)
