"""Time of one step of motion matching: the published loops against the exact fast search.

The database is made up: arms whose joint angles move smoothly and pause, so that poses are as
compressible as captured ones, and audio features that are nearly white, as the published ones are.
``--store`` also searches the training split of a prepared corpus.

Prints a table and, as the last line, the same numbers as JSON. Run:
python benchmarks/motion_matching.py
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.distance import cosine

from cospeech.corpus.store import Store
from cospeech.matching.database import MatchingDatabase, SpokenWords
from cospeech.matching.features import MatchingSpec, Normalisation, stack_taps
from cospeech.matching.fitting import fit_database
from cospeech.matching.reference import STEP_FRAMES, search_reference
from cospeech.matching.search import MatchingSearch, Query

PAPER_SEQUENCES = 9_624
CLIP_STEPS = 45  # 24 s, as the paper's clips
TOGETHER = 256  # queries
CAPTURE_NOISE = 0.001  # metres


def made_up_arms(rng: np.random.Generator, frames: int) -> np.ndarray:
    """``(frames, 24)`` positions of elbows, wrists and finger roots from twelve joint angles."""
    angles = gaussian_filter1d(rng.normal(size=(frames, 12)), 4.0, axis=0)
    angles /= angles.std(axis=0)
    # Hands pause between strokes: time runs at a speed that falls to nearly nothing now and then.
    speed = np.clip(gaussian_filter1d(rng.normal(size=frames), 6.0) * 5 + 0.8, 0.05, 1.5)
    clock = np.cumsum(speed) / 1.5
    places = np.arange(frames)
    angles = np.stack([np.interp(clock, places, angles[:, i]) for i in range(12)], axis=1)
    channels = []
    for side, a in ((-1.0, angles[:, :6].T), (1.0, angles[:, 6:].T)):
        upper = _direction(side * 0.4 + 0.35 * a[0], -1.2 + 0.25 * a[1])
        lower = _direction(side * 0.3 + 0.6 * a[2] + 0.3 * a[0], -0.2 + 0.55 * a[3] + 0.2 * a[1])
        hand = _direction(side * 0.2 + 0.6 * a[2] + 0.4 * a[4], -0.2 + 0.5 * a[3] + 0.4 * a[5])
        across = _direction(0.5 * a[4] + 1.5, 0.6 * a[5])
        elbow = np.array([side * 0.2, 0.45, 0.0]) + 0.3 * upper
        wrist = elbow + 0.26 * lower
        index, little = wrist + 0.09 * hand + 0.03 * across, wrist + 0.08 * hand - 0.03 * across
        channels += [elbow, wrist, index, little]
    positions = np.concatenate(channels, axis=1)
    return (positions + rng.normal(0, CAPTURE_NOISE, positions.shape)).astype(np.float32)


def _direction(heading: np.ndarray, height: np.ndarray) -> np.ndarray:
    flat = np.cos(height)
    return np.stack([np.sin(heading) * flat, np.sin(height), np.cos(heading) * flat], axis=1)


def made_up_database(sequences: int, seed: int = 0) -> MatchingDatabase:
    """A database of made-up motion and audio."""
    rng = np.random.default_rng(seed)
    spec = MatchingSpec()
    frames = spec.chunk_frames
    future = spec.reach(spec.audio_taps)
    pose = np.empty((sequences, frames, 96), dtype=np.float32)
    audio = np.empty((sequences, frames, 112), dtype=np.float32)
    per_take = 64
    for first in range(0, sequences, per_take):
        count = min(per_take, sequences - first)
        arms = made_up_arms(rng, count * frames + future)
        tone = gaussian_filter1d(rng.normal(size=(len(arms), 14)), 0.7, axis=0).astype(np.float32)
        for features, channels, taps in (
            (pose, arms, spec.pose_taps),
            (audio, tone, spec.audio_taps),
        ):
            stacked = stack_taps(channels, taps, spec.tap_spacing)[: count * frames]
            features[first : first + count] = stacked.reshape(count, frames, -1)
    normalisations = []
    for features in (pose, audio):
        blocks = [features[i] for i in range(0, sequences, max(1, sequences // 500))]
        normalisation = Normalisation.over(blocks.copy)
        for rows in range(0, sequences, 256):
            features[rows : rows + 256] = normalisation(features[rows : rows + 256])
        normalisations.append(normalisation)
    return MatchingDatabase(
        spec,
        pose,
        audio,
        np.zeros((sequences, frames, 0, 3), dtype=np.float32),
        np.full((sequences, frames), -1, dtype=np.int8),
        np.ones((sequences, frames), dtype=np.bool_),
        np.zeros(sequences, dtype=np.int32),
        np.zeros(sequences, dtype=np.int32),
        np.arange(sequences) * frames / spec.fps,
        SpokenWords((), *np.zeros((2, 0), dtype=np.int32), *np.zeros((2, 0))),
        ("made up",),
        normalisations[0],
        normalisations[1],
        (),
        (),
        (),
        "",
        "",
    )


def random_queries(
    database: MatchingDatabase, count: int, largest_k: int, seed: int = 1
) -> list[Query]:
    """Poses of the database, and its audio with noise, so that nothing is heard exactly.

    Half of them want the best candidate, half the second to ``largest_k``-th, as training pairs do.
    """
    rng = np.random.default_rng(seed)
    sequences, frames = database.usable.shape
    queries = []
    for _ in range(count):
        standing_on = int(rng.integers(sequences)), int(rng.integers(frames))
        heard = database.audio_features[rng.integers(sequences), rng.integers(frames - STEP_FRAMES)]
        audio = heard + 0.5 * rng.normal(size=len(heard))
        pose = np.array(database.pose_features[standing_on])
        k = int(rng.integers(2, largest_k + 1)) if largest_k > 1 and rng.random() < 0.5 else 1
        queries.append(Query(pose, audio.astype(np.float32), k, None, standing_on))
    return queries


def times_ms(function: Callable[[], object], repeats: int) -> list[float]:
    """Wall times of calls, after one that is not counted, ms."""
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(1e3 * (time.perf_counter() - start))
    return times


def reading_ms(size: int, threads: int) -> float:
    """Time to read so many bytes once, shared by threads: what no search that reads them beats."""
    parts = np.array_split(np.arange(size // 8), threads)
    with ThreadPoolExecutor(threads) as pool:
        return float(np.median(times_ms(lambda: list(pool.map(np.max, parts)), 9)))


def measure(database: MatchingDatabase, threads: int, slow_steps: int) -> dict[str, float]:
    """Every number of one database."""
    start = time.perf_counter()
    search = MatchingSearch(database, threads=threads)
    prepared = time.perf_counter() - start
    alone = random_queries(database, 20, 1)
    together = random_queries(database, TOGETHER, 15, seed=2)
    reference = np.nan
    if slow_steps:
        start = time.perf_counter()
        for query in alone[:slow_steps]:
            slow = search_reference(
                database, query.pose, query.audio, standing_on=query.standing_on
            )
            if slow != search(query):
                raise RuntimeError(f"the searches disagree: {slow}, {search(query)}")
        reference = 1e3 * (time.perf_counter() - start) / slow_steps
    starts = database.usable.shape[1] - STEP_FRAMES + 1
    row = {
        "sequences": len(database),
        "prepare_s": prepared,
        "published_loop_ms": published_loop_ms(database, alone[0]),
        "reference_ms": reference,
        "streamed_mb": search.streamed_bytes / 1e6,
        "read_streamed_ms": reading_ms(search.streamed_bytes, threads),
        "read_all_poses_ms": reading_ms(len(database) * starts * 4 * 96, threads),
        **timed(search, "pose", alone, together),
    }
    for preselect in ("audio", "pose_only"):
        search = MatchingSearch(database, preselect=preselect, threads=threads)
        row |= timed(search, preselect, alone, together)
    return row


def timed(
    search: MatchingSearch, name: str, alone: Sequence[Query], together: Sequence[Query]
) -> dict[str, float]:
    """Times of queries one by one and all at once, and the least of each, as others may be busy."""
    turn = iter(range(10**9))
    one = times_ms(lambda: search(alone[next(turn) % len(alone)]), 40)
    batch = [time / len(together) for time in times_ms(lambda: search.answer(together), 5)]
    return {
        f"{name}_one_ms": float(np.median(one)),
        f"{name}_one_least_ms": min(one),
        f"{name}_batch_ms_per_query": float(np.median(batch)),
        f"{name}_batch_least_ms_per_query": min(batch),
    }


def published_loop_ms(database: MatchingDatabase, query: Query, sequences: int = 300) -> float:
    """A step in the published way: a norm per frame, a sort and a SciPy cosine per sequence.

    Measured over the first sequences and scaled up; the final ranking isn't counted.
    """
    sequences = min(sequences, len(database))
    start = time.perf_counter()
    for m in range(sequences):
        poses = database.pose_features[m]
        distances = [np.linalg.norm(query.pose - poses[f]) for f in range(len(poses))]
        for f in np.argsort(distances):
            if distances[f] != 0 and f <= len(poses) - STEP_FRAMES:
                cosine(query.audio, database.audio_features[m, f])
                break
    return 1e3 * (time.perf_counter() - start) * len(database) / sequences


def growth(rows: Sequence[dict[str, float]], name: str) -> float:
    """Exponent of the power law of the number of sequences that fits best."""
    sizes, values = (np.log([row[key] for row in rows]) for key in ("sequences", name))
    return float(np.polyfit(sizes, values, 1)[0])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--sequences",
        type=int,
        nargs="+",
        default=[PAPER_SEQUENCES // 3, PAPER_SEQUENCES, 10 * PAPER_SEQUENCES],
        help="database sizes; ten times the paper's needs 9 GB of memory",
    )
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--slow-steps", type=int, default=1, help="steps of the reference, checked")
    parser.add_argument("--store", type=Path, help="a prepared corpus to search as well")
    arguments = parser.parse_args()

    rows = []
    for count in arguments.sequences:
        database = made_up_database(count)
        rows.append(measure(database, arguments.threads, arguments.slow_steps))
        del database
    exponents = {}
    if len(rows) > 1:
        exponents = {
            name: growth(rows, name) for name in ("pose_one_ms", "pose_batch_ms_per_query")
        }
    if arguments.store is not None:
        rows.append(measure(fit_database(Store(arguments.store)), arguments.threads, 1))
    for row in rows:
        published, one = row["published_loop_ms"], row["pose_one_ms"]
        print(f"{row['sequences']:.0f} sequences of 64 frames")
        print(f"  {'prepare the search':<40}{row['prepare_s']:10.2f} s")
        print(f"  {'published loop, extrapolated':<40}{published:10.1f} ms per step")
        print(f"  {'reference':<40}{row['reference_ms']:10.1f} ms")
        for name in ("pose", "audio", "pose_only"):
            alone, least = row[f"{name}_one_ms"], row[f"{name}_one_least_ms"]
            print(f"  {name + ': one query':<40}{alone:10.2f} ms, at least {least:.2f}")
            batch = row[f"{name}_batch_ms_per_query"]
            print(f"  {f'{name}: {TOGETHER} at once':<40}{batch:10.3f} ms, {1e3 / batch:.0f} per s")
        print(f"  {'published loop over one query':<40}{published / one:10.0f}")
        streamed = row["streamed_mb"]
        print(f"  {'streamed by a query, or by a group':<40}{streamed:10.1f} MB")
        print(f"  {'reading as much':<40}{row['read_streamed_ms']:10.2f} ms")
        print(f"  {'reading all pose features':<40}{row['read_all_poses_ms']:10.2f} ms")
        print(f"  {'a clip of 24 s':<40}{CLIP_STEPS * one / 1e3:10.2f} s")
    for name, exponent in exponents.items():
        print(f"{name} grows with sequences to the power of {exponent:.2f}")
    print(
        json.dumps(
            {
                "benchmark": "motion_matching",
                "threads": arguments.threads,
                "numba": numba.__version__,
                "rows": rows,
                "exponents": exponents,
            }
        )
    )


if __name__ == "__main__":
    main()
