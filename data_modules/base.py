"""What the data modules share: prepare a store once, serve its windows."""

from __future__ import annotations

import hashlib
import json
import logging
from abc import abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Protocol

from filelock import FileLock, Timeout
from lightning import LightningDataModule

from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS, Span, split_recordings, time_blocks
from cospeech.corpus.store import SCHEMA_VERSION, Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.windows import WindowDataset, WindowLoader, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.joint_map import JointMap
from cospeech.progress import progress_bar

logger = logging.getLogger(__name__)

SHORTEST_BLOCK = 44
"""Evaluation-rate frames that hold two windows; judging takes at least two."""

Reader = Callable[[], Recording]
"""Reads one recording; called when its turn comes."""


class StoreDataModule(LightningDataModule):
    """A corpus prepared into a store on first use and served as windows.

    A subclass names its sources (`sources`), yields its recordings (`readers`), and is otherwise
    settings.

    Args:
        name: Corpus name, used for the store's folder.
        store_dir: Folder that holds prepared stores.
        batch_size: Windows per training batch.
        seed: Seed of the batch order.
        split: ``"recordings"`` (held-out recordings of known speakers), ``"speakers"`` (held-out
            speakers) or ``"time_blocks"`` (each recording cut in time, for a handful of takes).
        val_share: Share for validation.
        test_share: Share for testing.
        split_seed: Seed of the split; apart from ``seed``, so that runs with other seeds are
            compared on the same split.
        strict: Fail on a bad recording instead of skipping it with a report.
        max_recordings: Use only so many recordings (debug runs); None for all.
    """

    def __init__(
        self,
        name: str,
        store_dir: str,
        batch_size: int,
        seed: int,
        split: str,
        val_share: float,
        test_share: float,
        split_seed: int,
        strict: bool,
        max_recordings: int | None,
    ) -> None:
        super().__init__()
        if split not in ("recordings", "speakers", "time_blocks"):
            raise ConfigError(f"data.split={split}: choose recordings, speakers or time_blocks")
        self.corpus_name, self.store_dir = name, Path(store_dir)
        self.batch_size, self.seed = batch_size, seed
        self.split, self.val_share, self.test_share = split, val_share, test_share
        self.split_seed, self.strict = split_seed, strict
        self.max_recordings = max_recordings
        self.allow_zero_length_dataloader_with_multiple_devices = False
        self._store: Store | None = None
        self._window: tuple[WindowSpec, frozenset[str]] | None = None

    @abstractmethod
    def sources(self) -> dict[str, Any]:
        """What the store's bytes depend on, as JSON values; a change makes another store."""

    @abstractmethod
    def readers(self) -> Iterable[tuple[str, Reader]]:
        """(recording id, reader) of every recording, in a fixed order."""

    def joint_map(self) -> JointMap | None:
        """Where the evaluation joints are; None: found by the joints' names."""
        return None

    def recording_count(self) -> int | None:
        """How many recordings `readers` will yield, where that is known beforehand."""
        return None

    # Preparation ---------------------------------------------------------------------------

    def store_parameters(self) -> dict[str, Any]:
        """Everything the store's content depends on."""
        return {
            "schema": SCHEMA_VERSION,
            "corpus": self.corpus_name,
            "sources": self.sources(),
            "split": [self.split, self.val_share, self.test_share, self.split_seed],
            "max_recordings": self.max_recordings,
        }

    def prepare_store(self) -> Store:
        """The store, built if it isn't there yet.

        Two processes that need the same store build it once: the second waits.
        """
        if self._store is None:
            parameters = self.store_parameters()
            text = json.dumps(parameters, sort_keys=True)
            fingerprint = hashlib.sha256(text.encode()).hexdigest()
            path = self.store_dir / f"{self.corpus_name}-{fingerprint[:10]}"
            if not (path / "manifest.json").is_file():
                self.store_dir.mkdir(parents=True, exist_ok=True)
                lock = FileLock(str(self.store_dir / f".{path.name}.lock"))
                try:
                    lock.acquire(timeout=0)
                except Timeout:
                    logger.info("another process is preparing %s; waiting for it", path)
                    lock.acquire()
                try:
                    if not (path / "manifest.json").is_file():
                        self._build(path, parameters, fingerprint)
                finally:
                    lock.release()
            self._store = self._checked(Store(path))
        return self._store

    def _checked(self, store: Store) -> Store:
        skipped = store.manifest["skipped"]
        if self.strict and skipped:
            first = skipped[0]
            raise CospeechError(
                f"{len(skipped)} recordings of {store.name} could not be used; the first is"
                f" {first['id']}: {first['reason']}",
                "data.strict=false goes on with the rest",
            )
        return store

    def _build(self, path: Path, parameters: dict[str, Any], fingerprint: str) -> None:
        name, joint_map = self.corpus_name, self.joint_map()
        with StoreWriter(path, name, parameters, fingerprint, joint_map) as writer:
            title = f"preparing {self.corpus_name}"
            bar = progress_bar(self.readers(), self.recording_count(), title)
            for recording_id, read in bar:
                try:
                    writer.add(read())
                except CospeechError as error:
                    if self.strict:
                        raise
                    writer.skip(recording_id, str(error))
                if len(writer.recordings) == self.max_recordings:
                    break
            writer.finish(self._spans(writer))

    def _spans(self, writer: StoreWriter) -> dict[str, list[Span]]:
        frames = writer.evaluation_frames()
        if self.split == "time_blocks":
            return time_blocks(frames, self.val_share, self.test_share, minimum=SHORTEST_BLOCK)
        speakers = [recording.speaker for recording in writer.recordings]
        names = split_recordings(
            speakers, self.val_share, self.test_share, self.split_seed, self.split
        )
        return {
            split: [Span(i, 0, frames[i]) for i, name in enumerate(names) if name == split]
            for split in SPLITS
        }

    # Windows -------------------------------------------------------------------------------

    def attach(self, method: WindowReader) -> None:
        """Serve the windows that a method works on."""
        self._window = (method.window, method.needs)

    @property
    def needs(self) -> frozenset[str]:
        """Batch fields that the attached method reads."""
        return frozenset() if self._window is None else self._window[1]

    def dataset(self, split: str) -> WindowDataset:
        """The fixed windows of one split for the attached method."""
        if self._window is None:
            raise RuntimeError("call attach(method) before asking for windows")
        spec, needs = self._window
        return WindowDataset(self.prepare_store(), split, spec, needs)

    def train_dataloader(self) -> WindowLoader:
        """Shuffled, last partial batch dropped (as published)."""
        return WindowLoader(self.dataset("train"), self.batch_size, self.seed, True, True)

    def val_dataloader(self) -> WindowLoader:
        """Every validation window in its fixed order."""
        return WindowLoader(self.dataset("val"), self.batch_size, self.seed, False, False)

    def test_dataloader(self) -> WindowLoader:
        """Every test window in its fixed order."""
        return WindowLoader(self.dataset("test"), self.batch_size, self.seed, False, False)


class WindowReader(Protocol):
    """Anything that works on windows: a method, or the motion auto-encoder."""

    window: WindowSpec
    needs: frozenset[str]
