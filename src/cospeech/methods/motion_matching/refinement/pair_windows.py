"""Windows with their own motion, the motion matched to them, and their speech."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import CospeechError
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.matching import Matched
from cospeech.matching.seams import Seam, blended
from cospeech.matching.search import MatchingSearch
from cospeech.matching.tracks import MatchingTracks
from cospeech.methods.motion_matching.refinement.pairing import make_pairs
from cospeech.methods.motion_matching.refinement.pairs import Pairs, PairSettings


class PairWindows(WindowDataset):
    """The windows of one split that something was matched to, with the field ``matched``.

    ``poses`` and ``matched`` are ``(B, T, J, 3)`` of the database's ``pose_roles``.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        needs: Names of fields to fill.
        tracks: The tracks that the pairs were made from.
        pairs: What was matched.
        database: What the pairs point into.
        step: Frames that each search added.
        seam: What happens between matched windows.

    Raises:
        ConfigError: A field that the corpus can't fill.
    """

    def __init__(
        self,
        store: Store,
        split: str,
        needs: frozenset[str],
        tracks: MatchingTracks,
        pairs: Pairs,
        database: MatchingDatabase,
        step: int,
        seam: Seam = "cut",
    ) -> None:
        settings = pairs.settings
        spec = WindowSpec(database.spec.fps, settings.frames, 0, settings.stride)
        places = np.asarray(pairs.windows, dtype=np.int64)
        super().__init__(store, split, spec, needs - {"matched"}, tracks.tracks, places)
        self.pairs, self._database, self._step, self._seam = pairs, database, step, seam
        self._serves_matched = "matched" in needs

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window, and where its matched motion comes from."""
        return {
            **super().describe(window),
            "k": int(self.pairs.ks[window]),
            "pointers": self.pairs.pointers[window].tolist(),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The windows at ``indices`` as one batch."""
        batch = super().batch(indices)
        if not self._serves_matched:
            return batch
        return batch.having(matched=torch.from_numpy(self.matched(np.asarray(indices))))

    def matched(self, indices: NDArray[np.int64]) -> NDArray[np.float32]:
        """``(B, T, J, 3)`` the motion matched to windows, seams included."""
        sequences, firsts = np.moveaxis(self.pairs.pointers[indices], -1, 0)
        within = firsts[..., None] + np.arange(self._step)
        poses = self._database.poses[sequences[..., None], within]
        poses = poses.reshape(len(indices), -1, *poses.shape[3:])[:, : self.spec.frames]
        if self._seam == "cut":
            return poses
        found = zip(poses, sequences, firsts, strict=True)
        return np.stack(
            [blended(Matched(*one), self._database, self._step, self._seam) for one in found]
        )


def open_pair_windows(
    store: Store,
    split: str,
    search: MatchingSearch,
    settings: PairSettings,
    seed: int,
    needs: frozenset[str],
    folder: Path | str,
    seam: Seam = "cut",
    same_speaker: bool = False,
    k: int = 1,
) -> PairWindows:
    """Read a split's tracks and match motion to its windows, or open what was matched before.

    Training windows are cut as the settings say; others lie side by side and have one candidate.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        search: The training split's database, and how it is searched.
        settings: For the training split.
        seed: Of all draws.
        needs: `GestureBatch` fields to fill.
        folder: Where pairs are kept.
        seam: What happens between matched windows.
        same_speaker: Keep windows to the motion of who speaks in them.
        k: Which candidate the others take.

    Raises:
        CospeechError: The split's joints aren't those of the database; see also `make_pairs`.
        ConfigError: No recording of the split has sound, or a field that can't be filled.
    """
    database = search.database
    tracks = MatchingTracks(store, split, database.spec.fps)
    if tracks.pose_roles != database.pose_roles:
        different = sorted(set(tracks.pose_roles) ^ set(database.pose_roles))
        raise CospeechError(
            f"{store.name}: its {split} recordings have other joints than the matching database"
            f" ({', '.join(different)})",
            "prepare those with and without fingers as two corpora",
        )
    settings = settings if split == "train" else settings.for_judging(k)
    speakers = None
    if same_speaker:
        speakers = [store.recordings[span.recording].speaker for span in tracks.spans]
    pairs = make_pairs(list(tracks), search, settings, seed, folder, speakers)
    return PairWindows(store, split, needs, tracks, pairs, database, search.step, seam)
