"""Write LMDB databases with the lmdb library, as the published ones were."""

from collections.abc import Mapping
from pathlib import Path

import lmdb


def write_lmdb(folder: Path, values: Mapping[bytes, bytes]) -> Path:
    """A database folder with a ``data.mdb`` alone, as published; returns the folder.

    Args:
        folder: Made where it doesn't exist; an existing database is added to.
        values: Bytes by key, in any order.
    """
    folder.mkdir(parents=True, exist_ok=True)
    room = 2**24 + 4 * sum(len(value) + 64 for value in values.values())
    with lmdb.open(str(folder), map_size=room) as database, database.begin(write=True) as writing:
        for key, value in values.items():
            writing.put(key, value)
    (folder / "lock.mdb").unlink()
    return folder
