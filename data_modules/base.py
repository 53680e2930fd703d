"""What the data modules share: prepare a store once, serve its windows."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout
from lightning import LightningDataModule

from cospeech.corpus.features import refuse_lacking
from cospeech.corpus.features.field import FieldSource
from cospeech.corpus.packing import PackedSource
from cospeech.corpus.reading import packed_sources, sensible_workers
from cospeech.corpus.source import Dropped, Source
from cospeech.corpus.split_facts import split_anew
from cospeech.corpus.splits import SPLITS, Span, published_spans, split_recordings, time_blocks
from cospeech.corpus.store import SCHEMA_VERSION, Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.window_loader import WindowLoader, WindowReader, open_windows
from cospeech.corpus.windows import ServesWindows
from cospeech.errors import ConfigError, CospeechError
from cospeech.progress import progress_bar

logger = logging.getLogger(__name__)

SHORTEST_BLOCK = 44
"""Evaluation-rate frames that hold two windows; judging takes at least two."""

SPLIT_RULES = ("published", "recordings", "speakers", "time_blocks")


@dataclass(kw_only=True, eq=False)
class StoreDataModule(LightningDataModule):
    """A corpus prepared into a store on first use and served as windows.

    A subclass names its corpus, finds its sources, and is otherwise settings.

    Args:
        store_dir: Folder that holds prepared stores.
        batch_size: Windows per training batch.
        seed: Seed of the batch order.
        split: ``"published"`` (the corpus's own), ``"recordings"`` (held-out recordings of known
            speakers), ``"speakers"`` (held-out speakers) or ``"time_blocks"`` (each recording cut
            in time, for a handful of takes).
        val_share: Share for validation.
        test_share: Share for testing.
        split_seed: Seed of the split; apart from ``seed``, so that runs with other seeds are
            compared on the same split.
        strict: Fail on a bad recording instead of skipping it with a report.
        max_recordings: Use only so many recordings (debug runs); None for all.
        encoder: What usually judges on this corpus, for ``conf/metrics``: ``"trained"`` on it,
            or ``"packaged"``. The store doesn't depend on it.
        workers: Processes that read the sources; None: one per core where it pays. The store's
            bytes are the same.

    Raises:
        ConfigError: ``split`` is none of the four.
    """

    store_dir: str
    batch_size: int
    seed: int
    split: str
    val_share: float
    test_share: float
    split_seed: int
    strict: bool
    max_recordings: int | None
    encoder: str = "trained"
    workers: int | None = None

    def __post_init__(self) -> None:
        super().__init__()
        if self.split not in SPLIT_RULES:
            raise ConfigError(f"data.split={self.split}: choose one of {', '.join(SPLIT_RULES)}")
        for name in ("workers", "max_recordings"):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, int) and value >= 1):
                raise ConfigError(f"data.{name}={value}: a number of at least 1, or null")
        self.allow_zero_length_dataloader_with_multiple_devices = False
        self._store: Store | None = None
        self._reader: WindowReader | None = None
        self._of_evaluation: frozenset[str] = frozenset()
        self._datasets: dict[str, ServesWindows] = {}

    @property
    @abstractmethod
    def corpus_name(self) -> str:
        """Name of the corpus and its store."""

    @abstractmethod
    def find_sources(self) -> Sequence[Source]:
        """What the corpus consists of, in a fixed order; no big file is opened.

        Raises:
            CospeechError: There is nothing of the kind; the message says what was looked for.
        """

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """What the recordings depend on besides their files, as JSON values."""

    @property
    def lacks(self) -> frozenset[FieldSource]:
        """What none of its recordings has, known without reading one."""
        return frozenset()

    @property
    def upper_body(self) -> bool:
        """Whether the corpus has the ten evaluation joints."""
        return "upper body" not in self.lacks

    @cached_property
    def sources(self) -> Sequence[Source]:
        """The corpus's sources."""
        return self.find_sources()

    def refuse_impossible(self, method: str, needs: frozenset[str]) -> None:
        """Say at once, before anything is prepared, that a method can't train on this corpus.

        Args:
            method: Its name.
            needs: Names of the fields that it reads.

        Raises:
            ConfigError: A field that doesn't exist, or that no recording can fill.
        """
        refuse_lacking(method, needs, self.corpus_name, self.lacks)

    # Preparation ---------------------------------------------------------------------------

    def store_parameters(self) -> dict[str, Any]:
        """Everything the store's content depends on."""
        files = sorted({path.absolute() for source in self.sources for path in source.files})
        # Names below the shared folder: the same corpus reached another way is the same.
        root = os.path.commonpath([path.parent for path in files]) if files else "."
        return {
            "schema": SCHEMA_VERSION,
            "corpus": self.corpus_name,
            "settings": self.settings(),
            "files": [[path.relative_to(root).as_posix(), *_stamp(path)] for path in files],
            "sources": len(self.sources),
            "split": [self.split, self.val_share, self.test_share, self.split_seed],
            "max_recordings": self.max_recordings,
        }

    def prepare_store(self) -> Store:
        """The store, built if it isn't there yet; a build that was killed goes on.

        Two processes that need the same store build it once: the second waits.
        """
        if self._store is None:
            parameters = self.store_parameters()
            fingerprint = _hash(parameters)
            reading = _hash({k: v for k, v in parameters.items() if k != "split"})
            folder = Path(self.store_dir)
            name = f"{self.corpus_name}-{reading[:10]}"
            path = folder / f"{name}-{fingerprint[:6]}"
            if not (path / "manifest.json").is_file():
                folder.mkdir(parents=True, exist_ok=True)
                lock = FileLock(str(folder / f".{name}.lock"))
                try:
                    lock.acquire(timeout=0)
                except Timeout:
                    logger.info("another process is preparing %s; waiting for it", path)
                    lock.acquire()
                try:
                    if not (path / "manifest.json").is_file():
                        self._build(path, parameters, fingerprint, reading)
                finally:
                    lock.release()
            store = Store(path)
            self._refuse_faults(Dropped(**item) for item in store.manifest["skipped"])
            self._store = store
        return self._store

    def _refuse_faults(self, dropped: Iterable[Dropped]) -> None:
        faults = [item for item in dropped if item.is_fault]
        if self.strict and faults:
            raise CospeechError(
                f"{faults[0].id} can't be used: {faults[0].reason}",
                "data.strict=false goes on with the rest",
            )

    def _build(
        self, path: Path, parameters: dict[str, Any], fingerprint: str, reading: str
    ) -> None:
        limit = self.max_recordings
        for other in path.parent.glob(f"{self.corpus_name}-{reading[:10]}-*/manifest.json"):
            logger.info("%s has the same recordings: they are split anew", other.parent)
            store = Store(other.parent)
            spans = self._spans(store.recordings.columns)
            split_anew(store, path, parameters, fingerprint, spans)
            return
        with StoreWriter(
            path,
            self.corpus_name,
            parameters,
            fingerprint,
            self.upper_body,
            reading,
            path.with_name(f".{self.corpus_name}-{reading[:10]}.building"),
        ) as writer:
            self._refuse_faults(writer.skipped)
            done = len(writer.sources_done)
            remaining = self.sources[done:]
            workers = self.workers or sensible_workers(remaining)
            if limit is not None:
                workers = 1  # sources read ahead would be read for nothing
            packed = packed_sources(remaining, self.upper_body, workers)
            total = None if limit is not None else len(self.sources)
            bar = progress_bar(packed, total, f"preparing {self.corpus_name}", done)
            # Closed at once where an error stops it, or the processes would read on.
            with closing(packed), closing(bar):
                self._append(bar, writer)
            writer.finish(self._spans(writer.columns()))

    def _append(self, packed: Iterable[PackedSource], writer: StoreWriter) -> None:
        limit = self.max_recordings
        if writer.recording_count == limit:
            return  # a build that was killed at its very end
        for source in packed:
            self._refuse_faults(source.dropped)
            if limit is not None:
                room = limit - writer.recording_count
                source = replace(source, recordings=source.recordings[:room])
            writer.append(source)
            if writer.recording_count == limit:
                break

    def _spans(self, columns: dict[str, list[Any]]) -> dict[str, list[Span]]:
        frames, rule = columns["frames"], self.split
        if rule == "published":
            published = columns["split"]
            if self.max_recordings is None or {"train", "val"} <= set(published):
                return published_spans(columns["id"], published, frames)
            logger.warning("so few recordings don't reach the published splits: split here instead")
            rule = "recordings"
        if rule == "time_blocks":
            if max(frames) >= SHORTEST_BLOCK * len(SPLITS) or len(frames) < len(SPLITS):
                return time_blocks(frames, self.val_share, self.test_share, minimum=SHORTEST_BLOCK)
            logger.warning("no recording is long enough for time blocks: split by recordings")
            rule = "recordings"
        names = split_recordings(
            columns["speaker"], self.val_share, self.test_share, self.split_seed, rule
        )
        return {
            split: [Span(i, 0, frames[i]) for i, name in enumerate(names) if name == split]
            for split in SPLITS
        }

    # Windows -------------------------------------------------------------------------------

    def attach(self, method: WindowReader, of_evaluation: Iterable[str] = ()) -> None:
        """Serve the windows that a method works on.

        Args:
            method: The method.
            of_evaluation: Further fields of the windows that it is judged on.
        """
        self._reader = method
        self._of_evaluation = frozenset(of_evaluation)
        self._datasets = {}

    @property
    def needs(self) -> frozenset[str]:
        """Batch fields that the attached method reads."""
        return frozenset() if self._reader is None else self._reader.needs

    def dataset(self, split: str) -> ServesWindows:
        """The fixed windows of one split for the attached method, made once."""
        if self._reader is None:
            raise RuntimeError("call attach(method) before asking for windows")
        if split not in self._datasets:
            more = frozenset[str]() if split == "train" else self._of_evaluation
            self._datasets[split] = open_windows(self.prepare_store(), split, self._reader, more)
        return self._datasets[split]

    def _loader(self, split: str, shuffle: bool) -> WindowLoader:
        dataset = self.dataset(split)
        runs = max(1, self.batch_size // dataset.spec.run)
        return WindowLoader(dataset, runs, self.seed, shuffle, shuffle)

    def train_dataloader(self) -> WindowLoader:
        """Shuffled, last partial batch dropped (as published)."""
        return self._loader("train", shuffle=True)

    def val_dataloader(self) -> WindowLoader:
        """Every validation window in its fixed order."""
        return self._loader("val", shuffle=False)

    def test_dataloader(self) -> WindowLoader:
        """Every test window in its fixed order."""
        return self._loader("test", shuffle=False)


def _stamp(path: Path) -> tuple[int, int]:
    """Size and time of a file; a link to nothing has neither, and reading it says what is wrong."""
    try:
        stat = path.stat()
    except OSError:
        return -1, 0
    return stat.st_size, stat.st_mtime_ns


def _hash(values: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
