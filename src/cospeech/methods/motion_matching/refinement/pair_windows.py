"""Windows with their own motion, the motion matched to them, and their speech."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.step_windows import evaluation_frames, upper_body_from
from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.matching import Matched
from cospeech.matching.seams import Seam, blended
from cospeech.matching.search import MatchingSearch
from cospeech.matching.tracks import Track, Tracks
from cospeech.methods.motion_matching.refinement.pairing import make_pairs
from cospeech.methods.motion_matching.refinement.pairs import Pairs, PairSettings
from cospeech.speech.feature_sets.sphinx import with_slopes

FIELDS = frozenset({"joints", "matched", "cepstra", "positions", "speakers"})
"""`GestureBatch` fields that `PairWindows` fills."""


class PairWindows:
    """The windows of one split, as pairs of real and matched motion; an item is a window.

    Fields served: ``joints`` and ``matched``, ``(B, T, J, 3)`` of the database's ``pose_roles``;
    ``cepstra``, ``(B, T, 28)``; ``speakers``; and ``positions``, which are the upper body over the
    same time at the evaluation rate.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        needs: `GestureBatch` fields to fill.
        tracks: The tracks that the pairs were made from.
        pairs: What was matched.
        database: What the pairs point into.
        step: Frames that each search added.
        seam: What happens between matched windows.

    Raises:
        ConfigError: A field that isn't served.
    """

    def __init__(
        self,
        store: Store,
        split: str,
        needs: frozenset[str],
        tracks: Sequence[Track],
        pairs: Pairs,
        database: MatchingDatabase,
        step: int,
        seam: Seam = "cut",
    ) -> None:
        if unknown := needs - FIELDS:
            raise ConfigError(f"pairs have no {sorted(unknown)}; they have {sorted(FIELDS)}")
        self.store, self.split, self.needs, self.pairs = store, split, needs, pairs
        fps, settings = database.spec.fps, pairs.settings
        self.spec = WindowSpec(fps, settings.frames, seed_frames=0, stride=settings.stride)
        self._database, self._step, self._seam = database, step, seam
        self.joints = np.concatenate([track.poses for track in tracks])
        self.cepstra = np.concatenate([with_slopes(track.audio) for track in tracks])
        of, first = np.asarray(pairs.windows).T
        lengths = [len(track.poses) for track in tracks]
        self.starts: NDArray[np.int64] = (np.cumsum(lengths) - lengths)[of] + first
        self.recordings = np.array([track.span.recording for track in tracks])[of]
        self.starts_s = np.array([track.start_s for track in tracks])[of] + first / fps

    def __len__(self) -> int:
        return len(self.starts)

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window, and where its matched motion comes from."""
        return {
            "window": int(window),
            "recording": self.store.recordings[int(self.recordings[window])].id,
            "start_s": float(self.starts_s[window]),
            "k": int(self.pairs.ks[window]),
            "pointers": self.pairs.pointers[window].tolist(),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The windows at ``indices`` as one batch."""
        indices = np.asarray(indices)
        rows = self.starts[indices][:, None] + np.arange(self.spec.frames)
        fields = {"window_ids": torch.as_tensor(indices, dtype=torch.int64)}
        if "joints" in self.needs:
            fields["joints"] = torch.from_numpy(self.joints[rows])
        if "matched" in self.needs:
            fields["matched"] = torch.from_numpy(self.matched(indices))
        if "cepstra" in self.needs:
            fields["cepstra"] = torch.from_numpy(self.cepstra[rows])
        recordings = self.recordings[indices]
        if "speakers" in self.needs:
            ids = [self.store.speaker_id(int(recording)) for recording in recordings]
            fields["speakers"] = torch.tensor(ids, dtype=torch.int64)
        if "positions" in self.needs:
            frames = evaluation_frames(self.spec)
            places = zip(recordings.tolist(), self.starts_s[indices].tolist(), strict=True)
            positions = [upper_body_from(self.store, *place, frames) for place in places]
            fields["positions"] = torch.from_numpy(np.stack(positions))
        return GestureBatch(**fields)

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
        ConfigError: No recording of the split has sound, or a field that isn't served.
    """
    database = search.database
    reader = Tracks(store, split, database.spec.fps)
    if reader.pose_roles != database.pose_roles:
        different = sorted(set(reader.pose_roles) ^ set(database.pose_roles))
        raise CospeechError(
            f"{store.name}: its {split} recordings have other joints than the matching database"
            f" ({', '.join(different)})",
            "prepare those with and without fingers as two corpora",
        )
    tracks = list(reader)
    settings = settings if split == "train" else settings.for_judging(k)
    speakers = None
    if same_speaker:
        speakers = [store.recordings[track.span.recording].speaker for track in tracks]
    pairs = make_pairs(tracks, search, settings, seed, folder, speakers)
    return PairWindows(store, split, needs, tracks, pairs, database, search.step, seam)
