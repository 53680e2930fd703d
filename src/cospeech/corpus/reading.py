"""Reading a corpus's sources, in this process or in several, always in the same order."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

from cospeech.corpus.packing import PackedSource, pack_source
from cospeech.corpus.source import Source
from cospeech.errors import CospeechError
from cospeech.motion.joint_map import JointMap

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
    for file in path.iterdir() if path.is_dir() else (path,):
        if file.is_file():
            yield file.stat().st_size


def packed_sources(
    sources: Iterable[Source],
    joint_map: JointMap | None,
    upper_body: bool,
    workers: int,
) -> Generator[PackedSource]:
    """Sources as they come out of `pack_source`, in their order whatever the number of workers.

    Args:
        sources: What to read.
        joint_map: Where the evaluation joints are; found by the joints' names when None.
        upper_body: Whether the corpus has the ten evaluation joints.
        workers: Processes; 1 reads in this one.

    Raises:
        CospeechError: A worker process died.
    """
    if workers <= 1:
        for source in sources:
            yield pack_source(source, joint_map, upper_body)
        return
    # Spawned, not forked: a fork beside torch's threads can hang.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_follow_the_parent)
    remaining = iter(sources)
    waiting: deque[tuple[str, Future[PackedSource]]] = deque()
    source_id = ""
    with _deaf_to_ctrl_c():
        pool.submit(int)  # the first task starts all processes
    try:
        while True:
            for source in islice(remaining, AHEAD * workers - len(waiting)):
                source_id = waiting[0][0] if waiting else source.id
                waiting.append((source.id, pool.submit(pack_source, source, joint_map, upper_body)))
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


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """Processes that start in here never hear Ctrl-C, not even before their first line runs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _follow_the_parent() -> None:
    """Leave Ctrl-C to the parent process, but end when it is gone, killed without a word."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
