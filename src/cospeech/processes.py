"""Processes that work for this one: spawned, deaf to Ctrl-C, gone when it is gone."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from itertools import islice
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")

AHEAD = 2
"""Items per process that are in work or done early: these are held in memory."""


class Processes(ProcessPoolExecutor):
    """A pool whose processes leave Ctrl-C to the one that started them.

    They are spawned, not forked: a fork beside torch's threads can hang. They end when their
    parent is gone, killed without a word.

    Args:
        workers: Processes at most; each starts when there is work for it.
    """

    def __init__(self, workers: int) -> None:
        context = multiprocessing.get_context("spawn")
        super().__init__(workers, mp_context=context, initializer=_end_with_the_parent)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """As the base's; a process that it starts never hears Ctrl-C, not even while it starts."""
        with _ctrl_c_waits():
            return super().submit(fn, *args, **kwargs)


def in_order(
    task: Callable[[Item], T], items: Iterable[Item], workers: int
) -> Generator[T, None, None]:
    """What a task makes of each item, in their order, whatever the number of workers.

    Closed early, it waits for what is being worked on and leaves the rest undone.

    Args:
        task: Does one item. Another process finds it by its name: a module's function, or a
            `functools.partial` of one.
        items: Taken from as there is work for them: `AHEAD` per worker are in work or wait to be
            given.
        workers: Processes; 1 works in this one.

    Raises:
        BrokenProcessPool: A process was killed.
    """
    if workers <= 1:
        yield from map(task, items)
        return
    pool, remaining = Processes(workers), iter(items)
    waiting: deque[Future[T]] = deque()
    try:
        while True:
            for item in islice(remaining, AHEAD * workers - len(waiting)):
                waiting.append(pool.submit(task, item))
            if not waiting:
                return
            yield waiting.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Hold Ctrl-C back: processes inherit the mask for life, this thread hears it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_wait_for_the_end, daemon=True).start()


def _wait_for_the_end() -> None:
    parent: Any = multiprocessing.parent_process()
    parent.join()
    os._exit(1)
