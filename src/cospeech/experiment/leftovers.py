"""The folder of a command that failed before it had anything worth keeping."""

from __future__ import annotations

import contextlib
import logging
import time
from pathlib import Path

from filelock import FileLock, Timeout

from cospeech.files import is_temporary
from cospeech.reporting.record import read_record

_FOLDERS = ("csv", "tensorboard", "wandb")
_FILES = (".lock", "record.json")

_process_began = time.time()


def remove_leftovers(folder: Path, itself: bool = True) -> None:
    """Remove what a failed command left, if it tells nothing that the terminal didn't.

    That is settings, this process's log, loggers without a step, empty folders, and a record that
    says ``failed`` of a run without an epoch. Where there is anything else, anything that is older
    than this process, or another process at work, everything stays.

    Args:
        folder: Where the command wrote.
        itself: Whether the folder goes too: not where the user had made or named it.
    """
    if not _is_empty_handed(folder):
        return
    lock = FileLock(str(folder / ".lock"))
    try:
        lock.acquire(timeout=0)
    except (Timeout, OSError):
        return
    try:
        for handler in _logs_in(folder):
            with contextlib.suppress(OSError):  # a full disk
                handler.close()
            logging.getLogger().removeHandler(handler)
        for path in sorted(folder.rglob("*"), reverse=True):  # what is in a folder comes before it
            with contextlib.suppress(OSError):
                path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
    finally:
        lock.release()
    with contextlib.suppress(OSError):
        (folder / ".lock").unlink(missing_ok=True)
        if itself:
            folder.rmdir()


def _is_empty_handed(folder: Path) -> bool:
    path = folder / "record.json"
    record = read_record(path)
    if path.exists() and (record.get("status") != "failed" or record.get("epochs")):
        return False
    logs = [Path(handler.baseFilename).name for handler in _logs_in(folder)]
    inside = list(folder.iterdir()) if folder.is_dir() else []
    return bool(inside) and all(_tells_nothing(path, logs) for path in inside)


def _tells_nothing(path: Path, logs: list[str]) -> bool:
    if path.is_symlink() or not _is_of_this_process(path):
        return False
    if path.is_dir():  # Hydra's begin with a dot, one for each process
        named = path.name in _FOLDERS or path.name.startswith((".hydra", ".pl_hydra"))
        inside = list(path.rglob("*"))
        return not inside or (named and all(map(_is_of_this_process, inside)))
    return path.name in _FILES or path.name in logs or is_temporary(path)


def _is_of_this_process(path: Path) -> bool:
    return _process_began <= path.lstat().st_mtime <= time.time()


def _logs_in(folder: Path) -> list[logging.FileHandler]:
    return [
        handler
        for handler in logging.getLogger().handlers
        if isinstance(handler, logging.FileHandler)
        and Path(handler.baseFilename).parent.resolve() == folder.resolve()
    ]
