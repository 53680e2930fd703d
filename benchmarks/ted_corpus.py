"""Preparing a TED-size corpus, and reading training windows from its store.

Fabricates databases in the published layout, prepares them with one process and with all cores
(seconds per hour of speech, the projected time of the published 97 h, peak memory of the largest
process), and reads random training batches from the store, beside a plain memory copy of the same
bytes. Prints two tables and, as the last line, the same numbers as JSON.

    python benchmarks/ted_corpus.py --hours 2
    python benchmarks/ted_corpus.py --hours 97 --folder DIR    # about 40 GB in DIR

Run from the repository's root.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED_HOURS, PUBLISHED_VIDEOS = 97, 1766
BATCH = 128
NEEDS = {
    "without raw audio": frozenset({"positions", "words", "speakers"}),
    "with raw audio": frozenset({"positions", "words", "speakers", "audio"}),
}


class PeakMemory:
    """Most memory of its own that this process or one of its children had (Linux).

    Pages of mapped files don't count: the system takes them back when it wants to.
    """

    def __enter__(self) -> PeakMemory:
        self.peak_mb = 0.0
        self._over = threading.Event()
        self._watch = threading.Thread(target=self._sample, daemon=True)
        self._watch.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._watch.join()

    def _sample(self) -> None:
        while not self._over.wait(0.05):
            processes = [os.getpid(), *(p.pid for p in multiprocessing.active_children())]
            for process in processes:
                with contextlib.suppress(OSError, StopIteration):
                    lines = Path(f"/proc/{process}/status").read_text().splitlines()
                    line = next(line for line in lines if line.startswith("RssAnon"))
                    self.peak_mb = max(self.peak_mb, int(line.split()[1]) / 1024)


def prepare(root: Path, store_dir: Path, workers: int) -> dict[str, float]:
    """Prepare once in this process and its workers; seconds and peak megabytes."""
    from data_modules.ted import TedData

    data = TedData(
        root=str(root),
        kind="auto",
        published_windows=True,
        store_dir=str(store_dir),
        batch_size=BATCH,
        seed=0,
        split="published",
        val_share=0.1,
        test_share=0.1,
        split_seed=0,
        strict=True,
        max_recordings=None,
        workers=workers,
    )
    start = time.perf_counter()
    with PeakMemory() as memory:
        store = data.prepare_store()
    seconds = time.perf_counter() - start
    start = time.perf_counter()
    type(store)(store.path)
    opened = time.perf_counter() - start
    hours = sum(span.stop - span.start for spans in store.splits.values() for span in spans)
    return {
        "workers": workers,
        "seconds": seconds,
        "hours": hours / 15 / 3600,
        "peak_mb": memory.peak_mb,
        "open_s": opened,
    }


def window_rates(store_dir: Path, seconds: float) -> list[dict[str, float | str]]:
    """Windows per second of random batches, and of copying as many bytes in memory."""
    from cospeech.corpus.store import Store
    from cospeech.corpus.windows import WindowDataset, WindowSpec

    (path,) = store_dir.glob("ted*")
    store, rows = Store(path), list[dict[str, float | str]]()
    for name, needs in NEEDS.items():
        dataset = WindowDataset(store, "train", WindowSpec(15, 34, 4, 10), needs)
        rng = np.random.default_rng(0)
        batch = dataset.batch(rng.integers(len(dataset), size=BATCH))
        arrays = [value.numpy() for value in batch.fields.values()]
        size = sum(array.nbytes for array in arrays)
        # Sources that don't fit in a cache, as the corpus doesn't.
        pool = [np.copy(array) for array in arrays for _ in range(-(-(64 << 20) // array.nbytes))]
        read = copied = 0
        start = time.perf_counter()
        while time.perf_counter() - start < seconds:
            dataset.batch(rng.integers(len(dataset), size=BATCH))
            read += BATCH
        read_rate = read / (time.perf_counter() - start)
        by_shape = [[a for a in pool if a.shape == b.shape and a.dtype == b.dtype] for b in arrays]
        start = time.perf_counter()
        while time.perf_counter() - start < seconds:
            for choices in by_shape:
                choices[rng.integers(len(choices))].copy()
            copied += BATCH
        copy_rate = copied / (time.perf_counter() - start)
        rows.append(
            {
                "fields": name,
                "windows": len(dataset),
                "kb_per_window": size / BATCH / 1024,
                "windows_per_s": read_rate,
                "memory_copy_per_s": copy_rate,
                "ratio": read_rate / copy_rate,
            }
        )
    return rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=2.0, help="length of the fabricated corpus")
    parser.add_argument(
        "--folder", type=Path, help="where it goes; a temporary folder if not given"
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="of reading windows")
    arguments = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    from tests.fabricated.ted import write_ted

    folder = arguments.folder or Path(tempfile.mkdtemp(prefix="ted-corpus-"))
    databases, stores = folder / "databases", folder / "stores"
    if not databases.exists():
        per_video = PUBLISHED_HOURS * 3600 / PUBLISHED_VIDEOS
        videos = max(10, round(arguments.hours * 3600 / per_video))
        start = time.perf_counter()
        write_ted(databases, videos=videos, seconds_per_video=arguments.hours * 3600 / videos)
        print(f"fabricated {videos} videos in {time.perf_counter() - start:.0f} s", flush=True)
    size = sum(path.stat().st_size for path in databases.rglob("data.mdb")) / 1e9

    rows = []
    context = multiprocessing.get_context("spawn")
    for workers in (1, multiprocessing.cpu_count()):
        shutil.rmtree(stores, ignore_errors=True)
        # A fresh process each, so that peak memory is its own.
        with ProcessPoolExecutor(1, mp_context=context) as fresh:
            rows.append(fresh.submit(prepare, databases, stores, workers).result())
    print(f"\n{size:.1f} GB of databases")
    print("| processes | speech, h | seconds | s per hour | 97 h, min | peak MB | opening, s |")
    print("| ---: " * 7 + "|")
    for row in rows:
        per_hour = row["seconds"] / row["hours"]
        print(
            f"| {row['workers']} | {row['hours']:.2f} | {row['seconds']:.1f} | {per_hour:.1f} |"
            f" {per_hour * PUBLISHED_HOURS / 60:.0f} | {row['peak_mb']:.0f} | {row['open_s']:.3f} |"
        )
    reading = window_rates(stores, arguments.seconds)
    print("\n| fields | windows | kB each | windows/s | memory copy/s | ratio |")
    print("| --- " + "| ---: " * 5 + "|")
    for rate in reading:
        print(
            f"| {rate['fields']} | {rate['windows']} | {rate['kb_per_window']:.1f} |"
            f" {rate['windows_per_s']:,.0f} | {rate['memory_copy_per_s']:,.0f} |"
            f" {rate['ratio']:.2f} |"
        )
    print(json.dumps({"gb": size, "prepare": rows, "windows": reading}))
    if arguments.folder is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
