"""Requests to stop from outside: SLURM, ``docker stop``, a closed terminal, a lost peer."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

STOP_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""What systems send to end a process; it has some seconds then."""

_PEER_SECONDS = 1.0
_FIRST = "COSPEECH_FIRST_PROCESS"


@contextmanager
def stopped_like_ctrl_c() -> Iterator[None]:
    """Inside, the signals that end a process raise `KeyboardInterrupt`, as Ctrl-C does.

    Signals that are ignored (``nohup``) stay so. Outside the main thread nothing changes.
    """
    before = {}
    # Lightning ignores Ctrl-C for good after the first; the next job of a sweep needs it.
    ctrl_c = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if in_main_thread:
        for number in STOP_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, _interrupt)
    try:
        yield
    finally:
        if in_main_thread:
            for number, handler in {**before, signal.SIGINT: ctrl_c}.items():
                signal.signal(number, handler)


def be_the_first_process() -> None:
    """Let the processes that this one starts know whom to end with."""
    os.environ[_FIRST] = str(os.getpid())


def end_with_the_first_process() -> None:
    """Have a further process of a distributed run end soon after the one that started it.

    Where that one is killed before the two have met, nothing else would tell this one.
    """
    parent = int(os.environ.get(_FIRST, os.getppid()))  # it may have gone already
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt(signal.Signals(number).name)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_PEER_SECONDS)
    os._exit(1)
