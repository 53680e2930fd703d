"""Reading training windows at a method's own rate: opening them, and random batches of runs.

Serves the embedded corpus as the multi-adversary method reads it (every interleave of 20 fps, runs
of four windows: joints, acoustics, phases, positions), beside a plain memory copy of as many bytes.
Prints a table and, as the last line, the same numbers as JSON.

    python benchmarks/windows.py --recordings 12

Run from the repository's root.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

RUNS = 32
NEEDS = frozenset({"joints", "acoustics", "phases", "positions"})


def main() -> None:
    """Prepare, open twice, read; print a table and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=12)
    parser.add_argument("--seconds", type=float, default=5.0)
    arguments = parser.parse_args()
    from cospeech.corpus.splits import Span
    from cospeech.corpus.store_writer import StoreWriter
    from cospeech.corpus.synthetic import synthesise
    from cospeech.corpus.windows import WindowDataset, WindowSpec

    spec = WindowSpec(20, 100, 0, 50, run=2, interleaved=True)
    with tempfile.TemporaryDirectory() as folder:
        with StoreWriter(Path(folder) / "s", "s", {}, "0") as writer:
            for recording in synthesise(arguments.recordings, seed=0, speakers=4):
                writer.add(recording)
            frames = writer.columns()["frames"]
            spans = [Span(i, 0, count) for i, count in enumerate(frames)]
            store = writer.finish({"train": spans, "val": [], "test": []})
        opened = []
        for _ in range(2):
            start = time.perf_counter()
            dataset = WindowDataset(store, "train", spec, NEEDS)
            opened.append(time.perf_counter() - start)
        rng = np.random.default_rng(0)
        rates = {"read": 0.0, "copied": 0.0}
        arrays = [v.numpy() for v in dataset.batch(range(RUNS)).fields.values()]
        pool = [np.copy(array) for array in arrays for _ in range(-(-(64 << 20) // array.nbytes))]
        for name in rates:
            count, start = 0, time.perf_counter()
            while time.perf_counter() - start < arguments.seconds:
                if name == "read":
                    dataset.batch(rng.integers(len(dataset), size=RUNS))
                else:
                    for array in arrays:
                        same = [a for a in pool if a.shape == array.shape]
                        same[rng.integers(len(same))].copy()
                count += RUNS
            rates[name] = count / (time.perf_counter() - start)
    result = {
        "runs": len(dataset),
        "first_opening_s": opened[0],
        "second_opening_s": opened[1],
        "runs_per_s": rates["read"],
        "memory_copy_per_s": rates["copied"],
        "ratio": rates["read"] / rates["copied"],
    }
    print("| " + " | ".join(result) + " |\n| " + " | ".join("---:" for _ in result) + " |")
    print("| " + " | ".join(f"{value:,.3g}" for value in result.values()) + " |")
    print(json.dumps(result))


if __name__ == "__main__":
    main()
