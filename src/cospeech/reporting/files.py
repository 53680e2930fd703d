"""Writing files so that a killed process, or a full disk, leaves the old one, or none."""

from __future__ import annotations

import errno
import glob
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cospeech.errors import CospeechError

_MOST_OF_A_NAME = 40
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path``, moved onto it when the block ends without an error.

    Missing parent folders are made. On an error the temporary file is removed and ``path`` is
    as it was.

    Raises:
        CospeechError: It can't be written: no room, no permission, a folder of that name.
    """
    target = Path(path)
    temporary = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=_prefix(target), suffix=target.suffix[:_MOST_OF_A_NAME], dir=target.parent
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        # mkstemp makes files private; a report is as readable as any other new file
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        _flush(temporary)
        temporary.replace(target)
    except OSError as error:
        raise _unwritable(target, temporary, error) from error
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def remove_temporaries(path: str | Path) -> None:
    """Remove what killed processes left beside a file while they wrote it with `replacing`.

    Args:
        path: The file; no other process may be writing it.
    """
    target = Path(path)
    pattern = f"{glob.escape(_prefix(target))}{'[a-z0-9_]' * 8}{glob.escape(target.suffix)}"
    for left in target.parent.glob(pattern):
        with suppress(OSError):
            left.unlink()


def _prefix(target: Path) -> str:
    # a temporary name is longer than the target's, which may be as long as names can be
    return f".{target.stem[:_MOST_OF_A_NAME]}."


def write_text(path: str | Path, text: str) -> None:
    """Write a text as UTF-8 by way of `replacing`.

    Half a surrogate pair, which can't be encoded, becomes ``?``.

    Raises:
        CospeechError: As for `replacing`.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="replace", newline="\n")


def _flush(path: Path) -> None:
    """To the disk itself: a name must not outlive, in a power cut, what it was given for."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _unwritable(target: Path, temporary: Path | None, error: OSError) -> CospeechError:
    reason = error.strerror or str(error) or type(error).__name__
    # the temporary name says nothing to a user, that of another file does
    if temporary and error.filename and str(error.filename) not in (str(temporary), str(target)):
        reason += f": {error.filename}"
    hint = (
        "free some space there, and run it again"
        if error.errno in _NO_ROOM
        else "check that this folder can be written to"
    )
    return CospeechError(f"{target}: can't be written ({reason})", hint)
