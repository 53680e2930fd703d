"""Rate at which published TED values are decoded, beside copying the same bytes.

The values are fabricated at the published sizes: videos of 20 clips of 10 to 20 s, cached samples,
and videos in the TED-Expressive style with one small array per frame. One core, arrays copied.
Prints a table and, as the last line, the same numbers as JSON.
Run: python benchmarks/legacy_arrow.py
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.formats.legacy_arrow import loads
from tests.fabricated.legacy_arrow_writer import write_legacy_arrow

FPS = 25.0
AUDIO_HZ = 16000


def words(random: np.random.Generator, start: float, stop: float) -> list[list[Any]]:
    """Words of 0.3 s back to back."""
    texts = ("so", "people", "talk", "with", "their", "hands", "when", "they", "listen")
    times = np.arange(start, stop, 0.3).round(3).tolist()
    return [[texts[random.integers(len(texts))], time, time + 0.3] for time in times]


def clip(random: np.random.Generator, start_frame: int, expressive: bool) -> dict[str, Any]:
    """One clip of 10 to 20 s; the arrays' contents don't matter."""
    frames = int(random.integers(int(10 * FPS), int(20 * FPS)))
    start, stop = start_frame / FPS, (start_frame + frames) / FPS
    samples = round((stop - start) * AUDIO_HZ)
    flat: Any = random.standard_normal((frames, 16)).astype("f2")
    posed: Any = random.standard_normal((frames, 10, 3)).astype("f2")
    if expressive:
        posed = list(random.standard_normal((frames, 43, 3)).astype("f4"))
        flat = random.standard_normal((frames, 24)).round(3).tolist()
    return {
        "words": words(random, start, stop),
        "skeletons": flat,
        "skeletons_3d": posed,
        "audio_feat": random.standard_normal((128, samples // 512 + 1)).astype("f2"),
        "audio_raw": random.standard_normal(samples).astype("f2"),
        "start_frame_no": start_frame,
        "end_frame_no": start_frame + frames,
        "start_time": start,
        "end_time": stop,
    }


def video(random: np.random.Generator, number: int, expressive: bool = False) -> bytes:
    """A video of 20 clips."""
    clips = [clip(random, 600 * index, expressive) for index in range(20)]
    return write_legacy_arrow({"vid": f"video{number}", "framerate": FPS, "clips": clips})


def cached_sample(random: np.random.Generator, number: int) -> bytes:
    """A window of 42 poses as the published preprocessing keeps it."""
    about = {
        "vid": f"video{number}",
        "start_frame_no": number,
        "end_frame_no": number + 42,
        "start_time": number / FPS,
        "end_time": (number + 42) / FPS,
        "is_correct_motion": True,
        "filtering_message": "PASS",
    }
    sample = [
        words(random, 0.0, 2.8),
        random.standard_normal((42, 10, 3)),
        random.standard_normal((42, 9, 3)),
        random.standard_normal(44800).astype("f2"),
        random.standard_normal((128, 86)).astype("f2"),
        about,
    ]
    return write_legacy_arrow(sample)


def megabytes_per_second(
    readers: Sequence[Callable[[bytes], object]], values: Sequence[bytes], repeats: int
) -> list[list[float]]:
    """Rates of each reader in turn over all values, by pass; one value is kept at a time."""
    rates: list[list[float]] = [[] for _ in readers]
    for _ in range(repeats + 1):
        for reader, its_rates in zip(readers, rates, strict=True):
            start = time.perf_counter()
            for value in values:
                reader(value)
            seconds = time.perf_counter() - start
            its_rates.append(sum(map(len, values)) / 1e6 / seconds)
    return rates


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--videos", type=int, default=12)
    parser.add_argument("--samples", type=int, default=600)
    parser.add_argument("--expressive", type=int, default=6, help="videos in that style")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()

    random = np.random.default_rng(0)
    values = {
        "video": [video(random, number) for number in range(arguments.videos)],
        "cached sample": [cached_sample(random, number) for number in range(arguments.samples)],
        "expressive video": [
            video(random, number, expressive=True) for number in range(arguments.expressive)
        ],
    }
    results = {}
    print(f"{'values':<18} {'count':>6} {'MB':>7} {'first MB/s':>11} {'MB/s':>7} {'copy MB/s':>10}")
    for name, written in values.items():
        # bytearray copies; bytes(value) would hand back the same object
        rates, copies = megabytes_per_second((loads, bytearray), written, arguments.repeats)
        first, again, copied = rates[0], float(np.median(rates[1:])), float(np.median(copies[1:]))
        size = sum(map(len, written)) / 1e6
        results[name] = {
            "count": len(written),
            "MB": size,
            "first_MB_per_s": first,
            "MB_per_s": again,
            "copy_MB_per_s": copied,
        }
        measured = f"{first:>11.0f} {again:>7.0f} {copied:>10.0f}"
        print(f"{name:<18} {len(written):>6} {size:>7.1f} {measured}")
    print(json.dumps({"benchmark": "legacy_arrow", "numpy": np.__version__, "values": results}))


if __name__ == "__main__":
    main()
