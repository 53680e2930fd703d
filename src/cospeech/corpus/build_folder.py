"""The folder a store is built in: growing files and a journal, so that a killed build goes on."""

from __future__ import annotations

import json
import logging
import shutil
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

from cospeech.errors import InputFileError
from cospeech.files import remove_temporaries, write_json
from cospeech.foreign import parse_json, read_json, understood

logger = logging.getLogger(__name__)

JOURNAL = "journal.jsonl"
BOOKS = (JOURNAL, "build.json")
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
        self._journal = (path / JOURNAL).open("ab")
        self._ends = dict.fromkeys(self._files, 0)

    def _made_by(self) -> Any:
        try:
            return read_json(self.path / "build.json", "an unfinished build")
        except InputFileError as error:
            if self.path.exists():
                logger.warning("%s: %s; the build starts anew", error.path, error.problem)
            return None

    def take_up(self) -> Iterator[dict[str, Any]]:
        """The journal of an earlier build; to be exhausted before anything is written."""
        sizes = {name: (self.path / name).stat().st_size for name in self._files}
        whole = 0
        with (self.path / JOURNAL).open("rb") as lines:
            for line in lines:
                if not line.endswith(b"\n"):
                    break  # the line that the kill cut short
                try:
                    entry, ends = self._entry(line)
                except InputFileError as error:
                    logger.warning("%s; what was built after it is built again", error)
                    break
                if any(ends[name] > sizes[name] for name in self._files):
                    break  # noted, but its bytes never reached the disk
                self._ends = ends
                whole += len(line)
                yield entry
        self._journal.truncate(whole)
        for name, end in self._ends.items():
            self._files[name].truncate(end)

    def _entry(self, line: bytes) -> tuple[dict[str, Any], dict[str, int]]:
        """What a line notes, and the ends of the files then: not before those of the line before.

        Raises:
            InputFileError: It isn't what `note` wrote.
        """
        path = self.path / JOURNAL
        with understood(path, "the journal of a build"):
            text, _, checksum = line.decode("utf-8").rstrip("\n").rpartition("\t")
            if checksum != _checksum(text):
                raise InputFileError(path, "a line of it is damaged")
            entry = parse_json(path, text, "the journal of a build")
            ends = entry.pop("ends")
            if any(ends[name] < end for name, end in self._ends.items()):
                raise InputFileError(path, "a line of it is damaged")
        return entry, ends

    def write(self, name: str, data: bytes) -> None:
        """Append to a file; it counts once `note` has been called."""
        self._files[name].write(data)
        self._ends[name] += len(data)

    def note(self, entry: dict[str, Any]) -> None:
        """Everything written so far is complete, and this is what it was."""
        for file in self._files.values():
            file.flush()
        text = json.dumps({**entry, "ends": self._ends})
        self._journal.write(f"{text}\t{_checksum(text)}\n".encode())
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
        remove_temporaries(path)  # of an earlier process, killed at its last step
        return True


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.encode()):08x}"


def json_line(values: Any) -> bytes:
    """JSON on one line."""
    return json.dumps(values).encode() + b"\n"
