"""Files of tensors and plain values."""

from __future__ import annotations

import os
import pickle
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from cospeech.errors import InputFileError

LARGEST_FILE_BYTES = 256 * 2**20


def write_weights(path: str | Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values; the file appears only when complete.

    Args:
        path: File to write; an existing one is replaced.
        content: What `read_weights` gives back.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        torch.save(content, temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_weights(
    path: str | Path,
    hint: str,
    *,
    kind: str = "weights",
    largest_bytes: int = LARGEST_FILE_BYTES,
    allowed: Sequence[type] = (),
) -> dict[str, Any]:
    """Read what `write_weights` wrote, on the CPU; nothing is unpickled.

    Args:
        path: The file.
        hint: What to do without it.
        kind: What the file should hold, in a word, for the messages.
        largest_bytes: Larger files, also when unpacked, are refused.
        allowed: Classes that may occur besides tensors and plain values.

    Raises:
        InputFileError: Missing, too large, unsafe to read, or no dictionary.
    """
    path = Path(path)
    if not path.is_file():
        raise InputFileError(path, f"no such {kind} file", hint=hint)
    size = path.stat().st_size
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            size = max(size, sum(entry.file_size for entry in archive.infolist()))
    if size > largest_bytes:
        raise InputFileError(path, f"{size / 2**20:.0f} MiB is too large", hint=hint)
    try:
        with torch.serialization.safe_globals(list(allowed)):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, KeyError) as error:
        reason = str(error).strip().split("\n", 1)[0]
        raise InputFileError(
            path, f"not a file that can be read safely ({reason})", hint=hint
        ) from error
    if not isinstance(content, dict):
        raise InputFileError(path, f"holds no {kind}", hint=hint)
    return content
