"""From speech to matched motion: what the methods that search a database share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.errors import ConfigError, CospeechError, require_choice, require_range
from cospeech.matching.control import ControlPlan, Controls, plan_controls
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.matching import Clip, Matched, match_together
from cospeech.matching.reference import STEP_FRAMES, Preselect
from cospeech.matching.seams import LEAST_INERTIAL_STEP, Seam, blended
from cospeech.matching.search import MatchingSearch
from cospeech.speech.speech import Speech, covering_frames

InitialPose = Literal["random", "mean"]


@dataclass(frozen=True)
class MatchingSettings:
    """How a database is searched; the published way by default.

    See docs/facts/motion_matching.md, section 4.

    Attributes:
        preselect: By what each sequence's candidate is found; ``"pose_only"`` hears nothing.
        step_frames: Frames that each search adds.
        k: Which candidate is taken, from 1.
        start_offset: 1 begins a window one frame after the one that is like the pose before it, so
            that no pose shows twice.
        natural_continuation: The sequence that a window came from offers the window that goes on
            there, instead of its nearest.
        initial_pose: ``"random"``: begin near a random frame; ``"mean"``: near the mean pose.
        seam: What happens between windows.

    Raises:
        ConfigError: A value out of range or not among the choices.
    """

    preselect: Preselect = "pose"
    step_frames: int = STEP_FRAMES
    k: int = 1
    start_offset: int = 0
    natural_continuation: bool = False
    initial_pose: InitialPose = "random"
    seam: Seam = "cut"

    def __post_init__(self) -> None:
        for name, value, choices in (
            ("preselect", self.preselect, get_args(Preselect)),
            ("initial_pose", self.initial_pose, get_args(InitialPose)),
            ("seam", self.seam, get_args(Seam)),
            ("start_offset", self.start_offset, (0, 1)),
        ):
            require_choice(f"model.{name}", value, choices)
        if self.seam == "inertialise" and self.step_frames < LEAST_INERTIAL_STEP:
            raise ConfigError(
                f"model.seam=inertialise with model.step_frames={self.step_frames}: what dies away"
                " would never have died away",
                f"use steps of {LEAST_INERTIAL_STEP} frames or more, or another seam",
            )
        for name in ("step_frames", "k"):
            require_range(f"model.{name}", getattr(self, name), 1)


@dataclass(frozen=True, eq=False)
class Synthesis:
    """Motion for one speech, and how it came about.

    Attributes:
        poses: ``(F, J, 3)`` of the database's ``pose_roles``, metres, in the body frame.
        matched: Where every window comes from; its poses are unblended.
        plan: What was asked for and held; None without controls.
    """

    poses: NDArray[np.float32]
    matched: Matched
    plan: ControlPlan | None


class MotionMatcher:
    """A database ready to be searched for speech.

    Args:
        database: What is searched.
        settings: How.
        threads: How many share a search; one per core when None.
    """

    def __init__(
        self, database: MatchingDatabase, settings: MatchingSettings, threads: int | None = None
    ) -> None:
        self.database, self.settings = database, settings
        self.search = MatchingSearch(
            database, settings.step_frames, settings.preselect, settings.start_offset, threads
        )

    def __call__(
        self,
        speech: Speech,
        controls: Controls | None = None,
        generator: torch.Generator | None = None,
        closed: Sequence[int] | NDArray[np.int64] | None = None,
    ) -> Synthesis:
        """Motion for speech of any length.

        Args:
            speech: Words are read where controls ask for keywords.
            controls: What the motion shall be like, and when.
            generator: Draws the first pose.
            closed: Sequences that aren't used.

        Returns:
            ``ceil(duration * fps)`` poses.

        Raises:
            CospeechError: The waveform holds NaN, or a step's controls leave no window and are
                said to be an error then.
        """
        queries = self._heard(
            speech.waveform, covering_frames(len(speech.waveform), self.database.spec.fps)
        )
        plan = None
        if controls is not None:
            steps = -(-len(queries) // self.settings.step_frames)
            plan = plan_controls(controls, self.search, steps, speech.words, closed)
        (matched,) = self._match([self._clip(queries, plan, closed)], generator)
        return Synthesis(self._blended(matched), matched, plan)

    def together(
        self,
        waveforms: Sequence[NDArray[np.float32]],
        frames: int,
        closed: Sequence[NDArray[np.int64] | None],
        generator: torch.Generator | None = None,
    ) -> list[Matched]:
        """Motion for several waveforms at once, uncontrolled.

        Args:
            waveforms: 16 kHz.
            frames: Frames of motion for each.
            closed: For each, sequences that aren't used.
            generator: Draws the first poses.

        Returns:
            For each what was matched; the poses are blended as the settings say.
        """
        clips = [
            self._clip(self._heard(wave, frames), None, shut)
            for wave, shut in zip(waveforms, closed, strict=True)
        ]
        found = self._match(clips, generator)
        return [Matched(self._blended(one), one.sequences, one.frames) for one in found]

    def _heard(self, waveform: NDArray[np.float32], frames: int) -> NDArray[np.float32]:
        if not np.isfinite(waveform).all():
            raise CospeechError("the waveform holds NaN or infinity", "check the audio file")
        if not frames:
            return np.zeros((0, self.database.audio_features.shape[2]), dtype=np.float32)
        return self.database.audio_queries(waveform, frames)

    def _clip(
        self,
        queries: NDArray[np.float32],
        plan: ControlPlan | None,
        closed: Sequence[int] | NDArray[np.int64] | None,
    ) -> Clip:
        settings = self.settings
        masks = None if plan is None else plan.masks
        shut = () if closed is None else np.asarray(closed, dtype=np.int64)
        return Clip(queries, masks, settings.k, shut, settings.initial_pose == "mean")

    def _match(self, clips: Sequence[Clip], generator: torch.Generator | None) -> list[Matched]:
        return match_together(self.search, clips, generator, self.settings.natural_continuation)

    def _blended(self, matched: Matched) -> NDArray[np.float32]:
        settings = self.settings
        return blended(matched, self.database, settings.step_frames, settings.seam)
