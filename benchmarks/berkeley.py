"""Rate and memory of reading the Berkeley sets, beside reading the same bytes.

A fabricated 3-D file (items of 64 frames as published, with sound, face and image names) is read
item by item, and a fabricated table of the 2-D set is indexed; one process each, so that peak
memory is its own.
Prints a table and, as the last line, the same numbers as JSON.
Run: python benchmarks/berkeley.py --items 3000 --rows 2000000
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.corpus.recording import Recording
from cospeech.formats.berkeley.extension3d import find_3d_sources
from cospeech.formats.berkeley.rows import index_rows
from tests.fabricated.berkeley import stamp, write_3d


def read_items(root: Path) -> int:
    """Every item of the 3-D set; how many there were."""
    recordings = (item for source in find_3d_sources(root) for item in source.read())
    return sum(isinstance(item, Recording) for item in recordings)


def index_table(path: Path) -> int:
    """The rows of a table of the 2-D set; how many intervals there were."""
    return len(index_rows(path, ("speaker", "interval_id")).runs)


def plain_seconds(path: Path) -> float:
    """Seconds to read a file in pieces of a megabyte, from the cache."""
    start = time.perf_counter()
    with path.open("rb") as file:
        while file.read(1 << 20):
            pass
    return time.perf_counter() - start


def measure(work: Callable[[Path], int], target: Path, file: Path) -> dict[str, Any]:
    """Seconds, then, in a second pass, the peak of allocated memory."""
    plain_seconds(file)
    start = time.perf_counter()
    found = work(target)
    seconds = time.perf_counter() - start
    return {"found": found, "seconds": seconds, "plain_s": plain_seconds(file)}


def peak_megabytes(work: Callable[[Path], int], target: Path) -> float:
    """Peak of what Python and numpy allocated."""
    tracemalloc.start()
    work(target)
    return tracemalloc.get_traced_memory()[1] / 1e6


def write_table(path: Path, rows: int) -> None:
    """A table of the 2-D set: 15 rows a second, 500 an interval."""
    with path.open("w") as file:
        file.write("frame_id,pose_dt,pose_fn,speaker,video_fn,interval_id,dataset\n")
        for i in range(rows):
            file.write(f"{i},{stamp(i / 15)},v/{i}.txt,oliver,v.mp4,i{i // 500},train\n")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--items", type=int, default=300, help="of the 3-D file")
    parser.add_argument("--rows", type=int, default=200_000, help="of the 2-D table")
    arguments = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    results: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="berkeley-") as folder:
        root, table = Path(folder) / "3d", Path(folder) / "frames_df.csv"
        root.mkdir()
        (npz,) = write_3d(root, counts={"train_noduplication": arguments.items}).values()
        write_table(table, arguments.rows)
        for name, work, target, file in (
            ("3-D npz, items", read_items, root, npz),
            ("2-D table, intervals", index_table, table, table),
        ):
            with ProcessPoolExecutor(1, mp_context=context) as fresh:
                result = fresh.submit(measure, work, target, file).result()
            with ProcessPoolExecutor(1, mp_context=context) as fresh:
                peak = fresh.submit(peak_megabytes, work, target).result()
            size = file.stat().st_size / 1e6
            results.append({"what": name, "mb": size, "peak_mb": peak, **result})
    print("| what | MB | found | seconds | MB/s | plain read MB/s | ratio | peak MB |")
    print("| --- " + "| ---: " * 7 + "|")
    for r in results:
        rate, plain = r["mb"] / r["seconds"], r["mb"] / r["plain_s"]
        print(
            f"| {r['what']} | {r['mb']:.0f} | {r['found']} | {r['seconds']:.2f} | {rate:.0f} |"
            f" {plain:.0f} | {rate / plain:.3f} | {r['peak_mb']:.1f} |"
        )
    print(json.dumps(results))


if __name__ == "__main__":
    main()
