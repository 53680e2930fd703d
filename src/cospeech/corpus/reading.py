"""Reading a corpus's sources, in this process or in several, always in the same order."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from itertools import islice
from pathlib import Path

from cospeech.corpus.packing import PackedSource, pack_source
from cospeech.corpus.source import Source
from cospeech.errors import CospeechError
from cospeech.processes import Processes

logger = logging.getLogger(__name__)

WORTH_A_PROCESS_BYTES = 64 << 20
"""Corpora smaller than this are read faster than a second Python starts."""

AHEAD = 2
"""Sources in work per process: what waits for its turn is held in memory."""


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
    with closing(_all_packed(sources, upper_body, workers)) as every:
        for packed in every:
            for dropped in packed.faults:
                if dropped.trace:
                    logger.debug("reading %s:\n%s", dropped.id, dropped.trace)
            yield packed


def _all_packed(
    sources: Iterable[Source], upper_body: bool, workers: int
) -> Generator[PackedSource]:
    if workers <= 1:
        for source in sources:
            yield pack_source(source, upper_body)
        return
    pool = Processes(workers)
    remaining = iter(sources)
    waiting: deque[tuple[str, Future[PackedSource]]] = deque()
    source_id = ""
    try:
        while True:
            for source in islice(remaining, AHEAD * workers - len(waiting)):
                source_id = waiting[0][0] if waiting else source.id
                waiting.append((source.id, pool.submit(pack_source, source, upper_body)))
            if not waiting:
                return
            source_id, future = waiting.popleft()
            yield future.result()
    except BrokenProcessPool:  # comes from submitting as well
        raise CospeechError(
            f"a process that was reading {source_id} or one of the next was killed, most"
            " likely for lack of memory",
            "start again with fewer: data.workers=1; what is done is kept",
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
