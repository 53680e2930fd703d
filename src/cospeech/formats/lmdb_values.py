"""Databases of values written by ``pyarrow.serialize``, as the TED Gesture set is published."""

from __future__ import annotations

from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.formats.legacy_arrow import LegacyArrowError, loads
from cospeech.formats.lmdb_file import find_values


def list_keys(path: str | Path) -> list[bytes]:
    """All keys of an LMDB database, in order.

    Args:
        path: Its folder, or the ``data.mdb`` itself.

    Raises:
        InputFileError: There is no database, or it is cut short or damaged.
    """
    return list(find_values(path).places)


def read_value(path: str | Path, key: bytes) -> object:
    """One value, decoded by `legacy_arrow.loads`.

    The database's tree is read once per process, so that many keys can be read one by one.

    Args:
        path: The database's folder, or the ``data.mdb`` itself.
        key: One of `list_keys`.

    Raises:
        InputFileError: As in `list_keys`; or the key isn't there; or the value can't be decoded,
            naming the key and the offset inside the value.
    """
    values = find_values(path)
    try:
        return loads(values.read(key))
    except LegacyArrowError as error:
        place = f"key {key.decode(errors='backslashreplace')}, byte {error.offset} of the value"
        raise InputFileError(values.path, error.problem, place, error.hint) from None
