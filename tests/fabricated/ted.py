"""Write databases in the TED set's published layout, of any size."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lmdb
import numpy as np

from cospeech.formats.ted.values import checked_clip
from tests.fabricated.legacy_arrow_writer import write_legacy_arrow
from tests.fabricated.ted_cache import cached_samples
from tests.fabricated.ted_clips import make_clip, moved_clip

FPS = 25.0
CLIP_SECONDS = (6.2, 9.4, 12.0, 15.1, 20.3)
DIFFERENT_CLIPS = 24
STILL_CLIPS = (5, 17)
SPLITS = ("lmdb_test", "lmdb_val", *["lmdb_train"] * 8)
"""Database by the last digit of a video's number (docs/facts/trimodal.md, section 3.4)."""


def write_ted(
    folder: Path, videos: int, seconds_per_video: float, seed: int = 0, cache: bool = False
) -> Path:
    """``lmdb_train``, ``lmdb_val`` and ``lmdb_test``; three videos or more fill all of them.

    Two dozen clips, two of them with a speaker who doesn't move, take turns in all videos; only
    their times and the text of their words differ, so that large sets are quickly written.

    Args:
        folder: Made where it doesn't exist.
        videos: Number of videos, over all splits.
        seconds_per_video: Seconds of clips in each video, at least; 200 is the real set's average.
        seed: Other seeds give other motion, sound and words.
        cache: Write the ``_cache`` databases instead.

    Returns:
        The folder.
    """
    clips = clip_pool(seed)
    for name in dict.fromkeys(SPLITS):
        mine = (i for i in range(videos) if SPLITS[i % 10] == name)
        made = ((i, make_video(i, clips, seconds_per_video, seed)) for i in mine)
        if cache:
            write_values(folder / f"{name}_cache", enumerate(_samples(v for _, v in made)))
        else:
            write_values(folder / name, made)
    return folder


def clip_pool(seed: int) -> list[dict[str, Any]]:
    """The clips that all videos are made of."""
    return [
        make_clip(
            CLIP_SECONDS[i % len(CLIP_SECONDS)],
            FPS,
            seed=1000 * seed + i,
            arm_swing=0.0 if i in STILL_CLIPS else 0.55,
        )
        for i in range(DIFFERENT_CLIPS)
    ]


def make_video(number: int, pool: list[dict[str, Any]], seconds: float, seed: int) -> dict:
    """One video; its arrays are those of the pool."""
    rng = np.random.default_rng([seed, 5, number])
    clips, frame, made_s = [], 75, 0.0
    while made_s < seconds:
        clip = moved_clip(pool[rng.integers(len(pool))], frame, FPS)
        # rare words by Zipf's law: a few thousand distinct ones in a large set
        for word, rank in zip(clip["words"], rng.zipf(1.4, len(clip["words"])), strict=True):
            word[0] += str(rank % 20000) if rank > 40 else ""
        clips.append(clip)
        made_s += clip["end_time"] - clip["start_time"]
        frame = clip["end_frame_no"] + int(rng.integers(40, 400))
    return {"vid": f"made{seed:02}-{number:04}", "framerate": FPS, "clips": clips}


def _samples(videos: Iterator[dict[str, Any]]) -> Iterator[list[Any]]:
    for video in videos:
        for clip in video["clips"]:
            for sample in cached_samples(checked_clip(clip), video["vid"]):
                words = [[word.text, word.start, word.end] for word in sample.words]
                arrays = [sample.poses, sample.directions, sample.audio, sample.spectrogram]
                yield [words, *arrays, sample.aux]


def write_values(folder: Path, values: Iterator[tuple[int, Any]]) -> None:
    """One database, its values written as they come; none of it stays in memory."""
    folder.mkdir(parents=True, exist_ok=True)
    # as much address space, not disk, as the published writer asked for
    with lmdb.open(str(folder), map_size=100 << 30, sync=False) as database:
        for number, value in values:
            with database.begin(write=True) as writing:
                writing.put(f"{number:010}".encode(), write_legacy_arrow(value))
        database.sync(True)
    (folder / "lock.mdb").unlink()
