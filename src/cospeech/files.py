"""Writing files so that a killed process, or a full disk, leaves the old one, or none."""

from __future__ import annotations

import errno
import glob
import json
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cospeech.errors import CospeechError

_MOST_OF_A_NAME = 40
"""A temporary name is longer than the file's own, which may be as long as names can be."""

_DRAWN, _SUFFIX = "[0-9a-f]" * 8, ".part"
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary file beside ``path``, moved onto it when the block ends without an error.

    It is on the disk before it gets its name. Its own name, which `remove_temporaries` knows, is
    hidden and has a suffix that nothing reads. Missing parent folders are made. On an error the
    temporary file is removed and ``path`` is as it was; where ``path`` is a symbolic link, the
    link is replaced.

    Raises:
        CospeechError: It can't be written: no room, no permission, or a folder, pipe or device has
            that name, or is what a link of that name points at.
    """
    target = Path(path)
    temporary = target.parent / f".{target.name[:_MOST_OF_A_NAME]}.{secrets.token_hex(4)}{_SUFFIX}"
    try:
        require_replaceable(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
        yield temporary
        flush(temporary)
        temporary.replace(target)
        _flush_folder(target.parent)
    except OSError as error:
        raise _unwritable(target, temporary, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def made_once(folder: Path) -> Iterator[Path]:
    """An empty folder beside ``folder``, renamed to it when the block ends without an error.

    What another process has put there meanwhile, with its ``manifest.json``, stays: it is as good.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    building = folder.with_name(f".{folder.name}.building-{os.getpid()}")
    shutil.rmtree(building, ignore_errors=True)
    building.mkdir()
    try:
        yield building
        try:
            building.rename(folder)
        except OSError:
            if not (folder / "manifest.json").is_file():
                raise
    finally:
        shutil.rmtree(building, ignore_errors=True)


def require_replaceable(path: Path) -> None:
    """Refuse what a file must not take the place of: folders, pipes, devices.

    Raises:
        CospeechError: It is one of these, or can't be looked at.
    """
    try:
        is_other = path.exists() and not path.is_file()
    except OSError as error:
        raise _unwritable(path, path, error) from error
    if is_other:
        hint = "give the name of a new file, or of one that is to be replaced"
        raise CospeechError(f"{path}: can't be written (it is not a file)", hint)


def behind_links(path: Path) -> Path:
    """What a user's own link stands for: that is to be written, and the link stays.

    Never for a name in a folder that may be a stranger's.
    """
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def remove_temporaries(folder: Path, name: str | None = None) -> None:
    """Remove what killed processes left while they wrote files with `replacing`.

    Args:
        folder: Where they wrote; no other process may be writing there.
        name: Of the file that they wrote; None for all of the folder.
    """
    begin = "*" if name is None else glob.escape(name[:_MOST_OF_A_NAME])
    for left in folder.glob(f".{begin}.{_DRAWN}{_SUFFIX}"):
        with suppress(OSError):
            left.unlink()


def is_temporary(path: Path) -> bool:
    """Whether `replacing` gives such names to what isn't complete."""
    return path.match(f".*.{_DRAWN}{_SUFFIX}")


def write_text(path: str | Path, text: str) -> None:
    """Write a text as UTF-8 by way of `replacing`.

    Half a surrogate pair, which can't be encoded, becomes ``?``.

    Raises:
        CospeechError: As for `replacing`.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="replace", newline="\n")


def write_json(path: str | Path, values: Any) -> None:
    """Write values as JSON on one line by way of `replacing`.

    Raises:
        CospeechError: As for `replacing`.
    """
    write_text(path, json.dumps(values))


def flush(path: Path) -> None:
    """To the disk itself: a name must not outlive, in a power cut, what it was given for."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Have a rename survive a power cut, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _unwritable(target: Path, temporary: Path, error: OSError) -> CospeechError:
    reason = error.strerror or str(error) or type(error).__name__
    # the temporary name says nothing to a user, that of another file does
    if error.filename and str(error.filename) not in (str(temporary), str(target)):
        reason += f": {error.filename}"
    hint = (
        "free some space there, and run it again"
        if error.errno in _NO_ROOM
        else "check that this folder can be written to"
    )
    return CospeechError(f"{target}: can't be written ({reason})", hint)
