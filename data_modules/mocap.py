"""`data=mocap`: any folder of BVH and audio, matched by file stem."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cospeech.corpus.recording import Recording
from cospeech.errors import CospeechError
from cospeech.formats.mocap import Take, find_takes, read_take
from cospeech.motion.joint_map import JointMap, load_joint_map
from data_modules.base import Reader, StoreDataModule


class MocapData(StoreDataModule):
    """Recordings as users have them: BVH, audio and, where there is one, a transcript.

    Args:
        root: The folder.
        store_dir: Folder that holds prepared stores.
        batch_size: Windows per training batch.
        seed: Seed of the batch order.
        speaker: Where a take's speaker is named: ``"folder"``, ``"prefix"`` or a regular
            expression (see `cospeech.formats.mocap.find_takes`).
        frame_rate: Frames per second of all BVH rows, for files whose header is wrong.
        joint_map: Name of a packaged joint map or path of a yaml, for skeletons whose joint names
            aren't known; null: found by the names.
        licence: Licence of the data, kept with each recording.
        split: ``"recordings"``, ``"speakers"`` or ``"time_blocks"``.
        val_share: Share for validation.
        test_share: Share for testing.
        split_seed: Seed of the split.
        strict: Fail on a bad recording instead of skipping it with a report.
        max_recordings: Use only so many recordings (debug runs); None for all.

    Raises:
        CospeechError: There is no such folder, or no take in it.
    """

    def __init__(
        self,
        root: str,
        store_dir: str,
        batch_size: int,
        seed: int,
        speaker: str,
        frame_rate: float | None,
        joint_map: str | None,
        licence: str,
        split: str,
        val_share: float,
        test_share: float,
        split_seed: int,
        strict: bool,
        max_recordings: int | None,
    ) -> None:
        self.root = Path(root)
        super().__init__(
            f"mocap-{self.root.resolve().name}",
            store_dir,
            batch_size,
            seed,
            split,
            val_share,
            test_share,
            split_seed,
            strict,
            max_recordings,
        )
        self.speaker, self.frame_rate, self.licence = speaker, frame_rate, licence
        self._joint_map = None if joint_map is None else load_joint_map(joint_map)

    @functools.cached_property
    def takes(self) -> list[Take]:
        """The takes found, by path."""
        takes = find_takes(self.root, speaker=self.speaker)
        if not takes:
            raise CospeechError(
                f"no BVH or audio file below {self.root}", "set data.root to the corpus's folder"
            )
        return takes

    def sources(self) -> dict[str, Any]:
        """Names, sizes and times of the files, and the settings they are read with."""
        files = [
            path
            for take in self.takes
            for path in (take.motion, take.audio, take.transcript)
            if path is not None
        ]
        # Names below the root: the same folder reached another way is the same corpus.
        stats = [(path.relative_to(self.root).as_posix(), path.stat()) for path in files]
        return {
            "files": [[name, stat.st_size, stat.st_mtime_ns] for name, stat in stats],
            "speaker": self.speaker,
            "frame_rate": self.frame_rate,
            "joint_map": None if self._joint_map is None else repr(self._joint_map),
            "licence": self.licence,
        }

    def joint_map(self) -> JointMap | None:
        """The user's choice, if any."""
        return self._joint_map

    def recording_count(self) -> int:
        """Number of takes found."""
        return len(self.takes)

    def readers(self) -> Iterable[tuple[str, Reader]]:
        """One reader per take."""
        for take in self.takes:
            yield take.id, functools.partial(self._read, take)

    def _read(self, take: Take) -> Recording:
        return read_take(
            take, frame_rate=self.frame_rate, joint_map=self._joint_map, licence=self.licence
        )
