"""The folder a store is built in: growing files and a journal, so that a killed build goes on."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

BOOKS = ("journal.jsonl", "build.json")
"""What only a build needs."""


class BuildFolder:
    """Files that only grow, and a journal of how far each had grown when a step was complete.

    What a killed build wrote after its last whole journal line is cut off again.

    Args:
        path: The folder.
        made_by: What the content depends on; a folder made by something else is begun anew.
        names: The files.
    """

    def __init__(self, path: Path, made_by: dict[str, Any], names: Iterable[str]) -> None:
        self.path = path
        if self._made_by() != made_by:
            shutil.rmtree(path, ignore_errors=True)
            path.mkdir(parents=True)
            write_json(path / "build.json", made_by)
        self._files: dict[str, IO[bytes]] = {name: (path / name).open("ab") for name in names}
        self._journal = (path / "journal.jsonl").open("ab")
        self._ends = dict.fromkeys(self._files, 0)

    def _made_by(self) -> Any:
        try:
            return json.loads((self.path / "build.json").read_text())
        except (OSError, ValueError):
            return None

    def take_up(self) -> Iterator[dict[str, Any]]:
        """The journal of an earlier build; to be exhausted before anything is written."""
        sizes = {name: (self.path / name).stat().st_size for name in self._files}
        whole = 0
        with (self.path / "journal.jsonl").open("rb") as lines:
            for line in lines:
                if not line.endswith(b"\n"):
                    break  # the line that the kill cut short
                try:
                    entry = json.loads(line)
                except ValueError:
                    break
                ends = entry.pop("ends")
                if any(ends[name] > sizes[name] for name in self._files):
                    break  # noted, but its bytes never reached the disk
                self._ends = ends
                whole += len(line)
                yield entry
        self._journal.truncate(whole)
        for name, end in self._ends.items():
            self._files[name].truncate(end)

    def write(self, name: str, data: bytes) -> None:
        """Append to a file; it counts once `note` has been called."""
        self._files[name].write(data)
        self._ends[name] += len(data)

    def note(self, entry: dict[str, Any]) -> None:
        """Everything written so far is complete, and this is what it was."""
        for file in self._files.values():
            file.flush()
        self._journal.write(json_line({**entry, "ends": self._ends}))
        self._journal.flush()

    def close(self) -> None:
        """Close the files; what is noted stays for the next build."""
        for file in (*self._files.values(), self._journal):
            file.close()

    def discard(self) -> None:
        """Remove everything."""
        shutil.rmtree(self.path, ignore_errors=True)

    def become(self, path: Path) -> bool:
        """Move the complete folder to its place, without the journal.

        Returns:
            False if something is there already.
        """
        if path.exists() and any(path.iterdir()):
            return False
        if path.exists():
            path.rmdir()
        self.path.rename(path)
        for name in BOOKS:
            (path / name).unlink(missing_ok=True)
        return True


def json_line(values: Any) -> bytes:
    """JSON on one line."""
    return json.dumps(values).encode() + b"\n"


def write_json(path: Path, values: Any) -> None:
    """Write a JSON file through to the disk."""
    with path.open("w") as file:
        json.dump(values, file)
        file.flush()
        os.fsync(file.fileno())
