"""Checkpoints that a kill or a full disk can't tear, and that are checked before they are used.

A checkpoint is an ordinary file of ``torch.save``, a zip archive, whose archive comment holds the
SHA-256 of everything before it. It is written beside its target, flushed to the disk and renamed,
so the target is the old checkpoint or the new one. Of the checkpoint that runs continue from the
one before is kept too.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import logging
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import torch
from lightning.fabric.plugins import CheckpointIO

from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import understood

LAST = "last.ckpt"
"""The checkpoint that runs continue from."""

_SEAL = b"cospeech sha256 "
_SEALED = re.compile(re.escape(_SEAL) + rb"([0-9a-f]{64})\Z")
_SEAL_BYTES = len(_SEAL) + 64
_CHUNK_BYTES = 2**20

logger = logging.getLogger(__name__)


class WholeCheckpoints(CheckpointIO):
    """Writes and reads the checkpoints of Lightning's trainer.

    When the checkpoint to continue from is damaged, that is said and the one before is taken.
    """

    def __init__(self) -> None:
        self._whole: set[Path] = set()

    def save_checkpoint(
        self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None
    ) -> None:
        """Replace a checkpoint as soon as the new one is whole on the disk.

        Raises:
            CospeechError: It can't be written; what was there is as it was.
        """
        path = _one_name(path)
        temporary = path.with_name(f".{path.name}.partial")  # one process writes a run's folder
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _write_sealed(checkpoint, temporary)
            if path.name == LAST and path in self._whole:
                _keep(path, previous_of(path))
            temporary.replace(path)
            _flush_folder(path.parent)
        except OSError as error:
            stays = "; the one before it is whole" if path.exists() else ""
            raise CospeechError(
                f"{path} can't be written ({error.strerror or error}){stays}",
                "see to the disk (df -h, quota, rights), then add ckpt_path=last to the command",
            ) from error
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        self._whole.add(path)

    def load_checkpoint(
        self,
        path: str | Path,
        map_location: Callable | None = None,
        weights_only: bool | None = None,
    ) -> dict[str, Any]:
        """A checkpoint on the CPU, or the one before where it is damaged; nothing is unpickled.

        Raises:
            InputFileError: It is damaged, and no other was kept.
            CospeechError: Both are damaged.
        """
        path = _one_name(path)
        previous = previous_of(path)
        faults: list[InputFileError] = []
        for candidate in (path, previous) if previous.is_file() else (path,):
            try:
                content = read_whole(candidate)
            except InputFileError as error:
                logger.warning("%s", error.problem)
                faults.append(error)
                continue
            if faults:
                logger.warning(
                    "continuing from the checkpoint before, %s: epoch %s, step %s",
                    candidate,
                    content.get("epoch"),
                    content.get("global_step"),
                )
            self._whole.add(candidate)
            return content
        if len(faults) == 1:
            raise faults[0]
        problems = "; ".join(error.problem for error in faults)
        raise CospeechError(f"no checkpoint is whole: {problems}", _START_AGAIN) from faults[0]

    def remove_checkpoint(self, path: str | Path) -> None:
        """Delete a checkpoint, if there is one."""
        Path(path).unlink(missing_ok=True)


_START_AGAIN = "start the run again without ckpt_path, or continue from another file: ckpt_path=FILE"


def previous_of(path: Path) -> Path:
    """Where the predecessor of a checkpoint is kept: ``last.previous.ckpt`` of ``last.ckpt``."""
    return path.with_name(f"{path.stem}.previous{path.suffix}")


def read_whole(path: Path, hint: str = _START_AGAIN) -> dict[str, Any]:
    """A checkpoint's content, checked against its checksum; nothing is unpickled.

    Args:
        path: The checkpoint; one without a checksum is read too.
        hint: What to do without it.

    Raises:
        InputFileError: Missing, damaged or of something else.
    """
    require_unbroken(path, hint)
    with understood(path, "a checkpoint", hint):
        content = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(content, dict) or "state_dict" not in content:
        raise InputFileError(path, "is no checkpoint", hint=hint)
    return content


def require_unbroken(path: Path, hint: str | None = None) -> None:
    """Check a file of ours against the checksum at its end, if it has one.

    Raises:
        InputFileError: Missing or unreadable, or a byte of it has changed.
    """
    with understood(path, "a checkpoint", hint), path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        start = max(size - _SEAL_BYTES, 0)
        file.seek(start)
        seal = _SEALED.match(file.read())
        if seal is None or start < 2:
            return
        file.seek(0)
        digest, left = hashlib.sha256(), start - 2
        while left > 0 and (chunk := file.read(min(left, _CHUNK_BYTES))):
            digest.update(chunk)
            left -= len(chunk)
        digest.update(b"\0\0")  # the length of the comment, before there was one
    if digest.hexdigest().encode() != seal[1]:
        raise InputFileError(path, "is damaged: its checksum is another", hint=hint)


def _one_name(path: str | Path) -> Path:
    return Path(path).parent.resolve() / Path(path).name


def _write_sealed(content: dict[str, Any], path: Path) -> None:
    """A file of ``torch.save`` with its SHA-256 as archive comment, flushed to the disk."""
    with path.open("wb") as file:
        hashing = _Hashing(file)
        try:
            torch.save(content, hashing)
        except Exception:
            if hashing.error is not None:  # torch makes a RuntimeError without a reason of it
                raise hashing.error from None
            raise
        seal = _SEAL + hashing.digest.hexdigest().encode()
        file.seek(-2, os.SEEK_END)
        file.write(len(seal).to_bytes(2, "little") + seal)
        file.flush()
        os.fsync(file.fileno())


class _Hashing(io.RawIOBase):
    """Passes what is written on, and hashes it."""

    def __init__(self, file: BinaryIO) -> None:
        super().__init__()
        self.digest = hashlib.sha256()
        self.error: OSError | None = None
        self._file = file

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        try:
            written = self._file.write(data)
        except OSError as error:
            self.error = error
            raise
        self.digest.update(data)
        return written


def _keep(path: Path, previous: Path) -> None:
    """Make a file's predecessor of it, while the file itself stays where links are known."""
    link = path.with_name(f".{path.name}.link")
    link.unlink(missing_ok=True)
    try:
        os.link(path, link)
    except OSError:
        path.replace(previous)
        return
    link.replace(previous)
    link.unlink(missing_ok=True)  # a rename between two links of one file does nothing


def _flush_folder(folder: Path) -> None:
    """Have a rename survive a power failure, where the system can."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
