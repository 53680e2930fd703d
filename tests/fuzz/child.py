"""Feeds one reader with mutated files, within 1 GB and 5 s each: a process that may die of it.

``python -m tests.fuzz.child READER FOLDER SEED FIRST STOP [STEP]``: inputs ``FIRST`` to ``STOP`` in
the folder. Input i depends on the reader's name, the seed and i alone. A line ``I KIND TEXT`` is
printed per failure, and a last line ``done READ REFUSED``.
"""

import contextlib
import io
import logging
import os
import random
import resource
import signal
import sys
import warnings
from pathlib import Path

from cospeech.errors import CospeechError
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import READERS

SECONDS = 5
ROOM_BYTES = 2**30


def main(name: str, folder: str, *numbers: str) -> None:
    seed, first, stop, *step = map(int, numbers)
    reader = READERS[name]
    here = Path(folder)
    (here / "seeds").mkdir(parents=True, exist_ok=True)
    (here / "at").write_text("seeds")
    paths = reader.seeds(here / "seeds")
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    originals = {path: path.read_bytes() for path in paths}
    for path in paths:
        reader.read(path)  # a seed that can't be read tries nothing
    limit = _address_space() + ROOM_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    read = refused = 0
    for i in range(first, stop, *step):
        chance = random.Random(f"{name}/{seed}/{i}")
        path = chance.choice(paths)
        data = mutated(originals[path], list(originals.values()), chance)
        path.write_bytes(data)
        (here / "at").write_text(f"{i} {path}")
        # Of this process's own seconds; the signal ends it.
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            with (
                contextlib.redirect_stdout(io.StringIO()),
                contextlib.redirect_stderr(io.StringIO()),
            ):
                reader.read(path)
            read += 1
        except CospeechError as error:
            refused += 1
            if _took_all_memory(error):
                _tell(here, i, path, data, "memory", error)
        except BaseException as error:  # whatever it is
            _tell(here, i, path, data, type(error).__name__, error)
        signal.setitimer(signal.ITIMER_PROF, 0)
        path.write_bytes(originals[path])
    print("done", read, refused, flush=True)


def _took_all_memory(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _tell(here: Path, i: int, path: Path, data: bytes, kind: str, error: BaseException) -> None:
    (here / f"failed-{i}-{path.name}").write_bytes(data)
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = "" if place is None else f"{place.tb_frame.f_code.co_filename}:{place.tb_lineno}"
    print(i, kind, f"{' '.join(str(error).split())[:200]} [{where}]", flush=True)


def _address_space() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main(*sys.argv[1:])
