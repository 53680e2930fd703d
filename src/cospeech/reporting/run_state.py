"""Whether a run's process is still at work, asked without leaving a trace."""

from __future__ import annotations

import os
from pathlib import Path


def is_at_work(folder: Path) -> bool | None:
    """Whether a process holds the ``.lock`` of a run's folder; None where that can't be told.

    It can't without the file, without a right to read it, and on systems whose locks are others.
    """
    try:
        import fcntl
    except ImportError:
        return None
    try:
        # neither a link nor a pipe is waited for
        lock = os.open(folder / ".lock", os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        # shared, so that two reports don't take each other for the run; closing gives it back
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return None
    finally:
        os.close(lock)
    return False
