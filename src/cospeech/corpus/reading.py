"""Reading a corpus's sources, in this process or in several, always in the same order."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from functools import partial
from pathlib import Path

from cospeech.corpus.packing import PackedSource, pack_source
from cospeech.corpus.source import Source
from cospeech.errors import CospeechError
from cospeech.processes import in_order

logger = logging.getLogger(__name__)

WORTH_A_PROCESS_BYTES = 64 << 20
"""Corpora smaller than this are read faster than a second Python starts."""


def usable_cores() -> int:
    """Cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def sensible_workers(sources: Iterable[Source]) -> int:
    """Processes worth starting for these sources: one per core, or only this one."""
    size = 0
    for path in {path for source in sources for path in source.files}:
        size += sum(_sizes(path))
        if size >= WORTH_A_PROCESS_BYTES:
            return usable_cores()
    return 1


def _sizes(path: Path) -> Iterator[int]:
    """Bytes of a file, or of the files directly in a folder that a source reads from."""
    try:
        for file in path.iterdir() if path.is_dir() else (path,):
            if file.is_file():
                yield file.stat().st_size
    except OSError:
        return  # reading it says what is wrong


def packed_sources(
    sources: Iterable[Source],
    upper_body: bool,
    workers: int,
) -> Generator[PackedSource]:
    """Sources as they come out of `pack_source`, in their order whatever the number of workers.

    Where unexpected errors came from is logged.

    Args:
        sources: What to read.
        upper_body: Whether the corpus has the ten evaluation joints.
        workers: Processes; 1 reads in this one.

    Raises:
        CospeechError: A worker process died.
    """
    started: deque[str] = deque()

    def noted() -> Iterator[Source]:
        for source in sources:
            started.append(source.id)
            yield source

    try:
        with closing(
            in_order(partial(pack_source, upper_body=upper_body), noted(), workers)
        ) as done:
            for packed in done:
                started.popleft()
                for dropped in packed.faults:
                    if dropped.trace:
                        logger.debug("reading %s:\n%s", dropped.id, dropped.trace)
                yield packed
    except BrokenProcessPool:
        raise CospeechError(
            f"a process that was reading {started[0]} or one of the next was killed, most"
            " likely for lack of memory",
            "start again with fewer: data.workers=1; what is done is kept",
        ) from None
