"""What the methods that search a matching database share: opening it, speaking, judging."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, distributed

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.matching.control import Controls
from cospeech.matching.database import MatchingDatabase, check_database, open_database
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import fit_database
from cospeech.matching.streaming import MatchedPieces
from cospeech.matching.synthesis import MatchingSettings, MotionMatcher
from cospeech.methods.base import GestureMethod
from cospeech.methods.streams import Stream, WholeUtterance
from cospeech.metrics.movement import border_steps
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech

K_NN = "k-NN"
"""Name of the stage that is the search's own output."""


class MatchedMethod(GestureMethod):
    """Motion out of a database of recorded windows (Habibie et al. 2022).

    The database is fitted to the corpus's training split on first use and lies beside its store; a
    checkpoint knows it by its hash.

    Args:
        corpus: Where the store is, and its speakers.
        spec: How the database is cut.
        matching: How it is searched.
        same_speaker: Use the motion of one speaker at a time: the one asked for, or one drawn.
        database: Folder of a database, in place of the corpus's own.
    """

    window = WindowSpec(fps=15.0, frames=64, seed_frames=0, stride=64)
    needs: ClassVar[frozenset[str]] = frozenset({"audio", "speakers"})

    database_hash: Tensor

    def __init__(
        self,
        corpus: CorpusFacts,
        spec: MatchingSpec,
        matching: MatchingSettings,
        same_speaker: bool,
        database: str | None,
    ) -> None:
        super().__init__()
        self.speakers = list(corpus["speakers"])
        self._store, self._fingerprint = corpus["store"], corpus["fingerprint"]
        self.spec, self.matching, self.same_speaker = spec, matching, same_speaker
        self._folder = database
        self.register_buffer("database_hash", torch.zeros(32, dtype=torch.uint8))
        self._matcher: MotionMatcher | None = None
        self._border_steps: list[list[NDArray[np.float64]]] = [[], []]

    # The database --------------------------------------------------------------------------

    @property
    def matcher(self) -> MotionMatcher:
        """The search, its database opened or fitted on first use.

        Raises:
            CospeechError: The corpus isn't there any more, or the database isn't the one that the
                checkpoint was made with.
        """
        if self._matcher is None:
            database = self._open()
            known = bytes(self.database_hash.tolist()).hex()
            if self.database_hash.any() and known != database.hash:
                raise CospeechError(
                    f"this checkpoint was made with matching database {known[:12]}, and the"
                    f" corpus's is {database.hash[:12]}",
                    "put the corpus's files back as they were, or name the folder of the old"
                    " database: database=DIR for generate.py, load_from_checkpoint(path,"
                    " database=DIR) in Python",
                )
            self._matcher = MotionMatcher(database, self.matching)
        return self._matcher

    @classmethod
    def needs_store(cls, arguments: Mapping[str, Any]) -> bool:
        """Its database lies beside the corpus, unless another one is named."""
        return not arguments.get("database")

    @property
    def database(self) -> MatchingDatabase:
        """The database that is searched."""
        return self.matcher.database

    def _open(self) -> MatchingDatabase:
        if self._folder is not None:
            check_database(self._folder)
            return open_database(self._folder)
        path = Path(self._store)
        if not (path / "manifest.json").is_file():
            raise CospeechError(
                f"{path}: the prepared corpus is gone, and with it the matching database",
                "prepare it again (python prepare.py data=NAME), or name the database's folder:"
                " database=DIR for generate.py, load_from_checkpoint(path, database=DIR) in Python",
            )
        store = Store(path)
        if store.fingerprint != self._fingerprint:
            raise CospeechError(
                f"{path} holds another corpus now ({store.fingerprint[:12]}, not"
                f" {self._fingerprint[:12]})",
                "prepare the corpus of the run again, or train on this one",
            )
        return fit_database(store, self.spec)

    def fit_to_corpus(self) -> None:
        """Fit or open the database, and keep its hash."""
        hashed = bytearray.fromhex(self.database.hash)
        self.database_hash.copy_(torch.frombuffer(hashed, dtype=torch.uint8))

    # Motion --------------------------------------------------------------------------------

    @abstractmethod
    def stages(
        self,
        speech: Speech,
        controls: Controls | None,
        generator: torch.Generator,
        speaker: str | None = None,
    ) -> dict[str, NDArray[np.float32]]:
        """Motion after each stage of the method; the last is what it puts out.

        Args:
            speech: Of any length.
            controls: What the motion shall be like, and when.
            generator: Draws the first pose, and the speaker where none is named.
            speaker: Whose motion is used, where the method uses one speaker's.

        Returns:
            Name of the stage -> ``(F, J, 3)`` of ``database.pose_roles``, metres, body frame.
        """

    def closed_sequences(
        self, speaker: str | None, generator: torch.Generator
    ) -> NDArray[np.int64] | None:
        """The sequences that aren't used for a speaker; None where all are used."""
        return self.database.of_others(speaker, generator) if self.same_speaker else None

    @torch.no_grad()
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item.

        Returns:
            ``(B, 64, 10, 3)``.
        """
        return self._upper_body(self._sample_poses(batch, generator))

    def _sample_poses(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        waveforms = [wave.numpy() for wave in batch.require("audio").cpu()]
        names = [
            self.speakers[number - 1] if number else None
            for number in batch.require("speakers").tolist()
        ]
        closed = [self.closed_sequences(name, generator) for name in names]
        found = self.matcher.together(waveforms, self.window.frames, closed, generator)
        return torch.from_numpy(np.stack([matched.poses for matched in found]))

    def _upper_body(self, poses: Tensor) -> Tensor:
        return torch.from_numpy(self.database.upper_body(poses.cpu().numpy())).to(self.device)

    def parse_controls(self, values: Any) -> Controls:
        """A schedule, as `cospeech.matching.control.Controls.from_dict` reads it.

        Raises:
            ConfigError: Something isn't understood; the message names the entry.
        """
        return Controls.from_dict(values)

    def begin(
        self,
        speaker: str | None,
        controls: Controls | None,
        seed_motion: Motion | None,
        generator: torch.Generator,
    ) -> Stream:
        """Begin upper-body motion at 15 fps on `UPPER_BODY`.

        Words are read where controls ask for keywords. Without a speaker one is drawn, where motion
        of one speaker is used. With controls the whole speech is waited for: a keyword holds before
        its word is said.
        """
        if controls is not None:
            return WholeUtterance(
                lambda speech: self.upper_body_motion(
                    list(self.stages(speech, controls, generator, speaker).values())[-1]
                )
            )
        closed = self.closed_sequences(speaker, generator)
        return self.stream(MatchedPieces(self.matcher, closed, generator))

    @abstractmethod
    def stream(self, pieces: MatchedPieces) -> Stream:
        """The last of the `stages` of a speech without controls, as far as it was heard.

        Args:
            pieces: The search.
        """

    def upper_body_motion(self, poses: NDArray[np.float32]) -> Motion:
        """What is put out of ``(F, J, 3)`` poses of the database's roles."""
        return Motion(UPPER_BODY, self.window.fps, self.database.upper_body(poses))

    # Judging -------------------------------------------------------------------------------

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Sampled positions for the evaluation callback; counts steps at seams and inside."""
        generator = torch.Generator().manual_seed(batch_idx)
        poses = self._sample_poses(batch, generator)
        for window in poses.cpu().numpy():
            for kept, steps in zip(
                self._border_steps, border_steps(window, self.matching.step_frames), strict=True
            ):
                kept.append(steps)
        return self._upper_body(poses)

    def on_validation_epoch_start(self) -> None:
        """Count anew."""
        self._border_steps = [[], []]

    def on_validation_epoch_end(self) -> None:
        """Log the median step at the search's seams over the one inside: 1 where none is seen."""
        self._log_seam("val")

    def on_test_epoch_start(self) -> None:
        """As for validation."""
        self.on_validation_epoch_start()

    def on_test_epoch_end(self) -> None:
        """As for validation."""
        self._log_seam("test")

    def _log_seam(self, stage: str) -> None:
        self.log(f"{stage}/seam", self.seam(), sync_dist=True)

    def seam(self) -> float:
        """Median step at seams over the median step inside, of what was validated last.

        Of all processes' windows; 1 where there are no seams, or nothing else.
        """
        parts: list[Any] = [self._border_steps]
        if distributed.is_available() and distributed.is_initialized():
            parts = [None] * distributed.get_world_size()
            distributed.all_gather_object(parts, self._border_steps)
        at_border, inside = (
            np.concatenate([steps for part in parts for steps in part[side]] or [np.empty(0)])
            for side in (0, 1)
        )
        if not len(at_border) or not len(inside):
            return 1.0
        return float(np.median(at_border) / max(np.median(inside), 1e-9))
