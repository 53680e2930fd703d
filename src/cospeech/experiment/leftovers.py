"""The folder of a command that failed before it had anything worth keeping."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

from filelock import FileLock, Timeout

from cospeech.reporting.record import read_record

_FOLDERS = ("csv", "tensorboard", "wandb")
_FILES = (".lock", "record.json")


def remove_leftovers(folder: Path) -> bool:
    """Remove the folder of a failed command, if it tells nothing that the terminal didn't.

    That is a folder of settings, a log, loggers without a step, and a record that says ``failed``
    of a run without an epoch. The folder of a run that another process is at work in stays.

    Args:
        folder: Hydra's output folder of the command.

    Returns:
        Whether it was removed.
    """
    if not folder.is_dir() or not _is_empty_handed(folder):
        return False
    lock = FileLock(str(folder / ".lock"))
    try:
        lock.acquire(timeout=0)
    except (Timeout, OSError):
        return False
    try:
        for handler in list(logging.getLogger().handlers):
            inside = Path(getattr(handler, "baseFilename", "/")).parent == folder.resolve()
            if isinstance(handler, logging.FileHandler) and inside:
                handler.close()
                logging.getLogger().removeHandler(handler)
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        lock.release()
    return not folder.exists()


def _is_empty_handed(folder: Path) -> bool:
    path = folder / "record.json"
    record = read_record(path)
    if path.exists() and (record.get("status") != "failed" or record.get("epochs")):
        return False
    return (folder / ".hydra").is_dir() and all(_tells_nothing(path) for path in folder.iterdir())


def _tells_nothing(path: Path) -> bool:
    if path.is_symlink():
        return False
    if path.is_dir():  # Hydra's begin with a dot, one for each process
        named = path.name in _FOLDERS or path.name.startswith((".hydra", ".pl_hydra"))
        return named or not any(path.iterdir())
    return path.name in _FILES or path.suffix == ".log"
