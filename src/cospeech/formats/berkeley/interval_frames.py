"""The frames of one interval, from its keypoint files or put together from extracted samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import open_file
from cospeech.formats.berkeley.keypoints import (
    COUNT,
    MAX_FILE_BYTES,
    parse_keypoints,
    without_face,
)
from cospeech.formats.berkeley.layout import below, parse_time, spellings
from cospeech.formats.berkeley.rows import Key, RowIndex
from cospeech.formats.npz_file import NpzReader
from cospeech.speech.speech import SAMPLE_RATE

FRAME_COLUMNS = ("speaker", "interval_id", "pose_fn", "pose_dt", "dataset")
"""What the table of frames must have."""
SAMPLE_COLUMNS = ("speaker", "interval_id", "pose_fn", "start", "end", "dataset")
"""What ``train.csv`` must have."""
NTSC_FPS = 30000 / 2002
"""Every second frame of a 29.97 fps video."""
VIDEO_FPS = (NTSC_FPS, 15.0)

MAX_STRETCH_FRAMES = 18_000
"""20 minutes; a longer stretch goes on in another recording."""
_MAX_SAMPLE_FRAMES = 4096
_RATE_TOLERANCE = 0.02


@dataclass
class IntervalFrames:
    """One interval's frames, in order.

    Attributes:
        times: ``(T,)`` seconds in the video, float64.
        keypoints: ``(T, 2, 49)`` pixels, y down.
        dataset: Published split of its first frame.
        video: Name of the video.
        link: Where the video is on the web; "" where unknown.
        sounds: (seconds in the video, samples at 16 kHz) of overlapping pieces, in order; None
            where the audio is elsewhere.
        problems: (kind, what was left out), one per kind.
    """

    times: NDArray[np.float64]
    keypoints: NDArray[np.float64]
    dataset: str
    video: str
    link: str = ""
    sounds: list[tuple[float, NDArray[np.float32]]] | None = None
    problems: list[tuple[str, str]] = field(default_factory=list)


_Row = TypeVar("_Row")


class _Problems:
    """Counts what is wrong with files and keeps the first of each kind."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.first: dict[str, str] = {}

    def add(self, kind: str, problem: str) -> None:
        self.counts[kind] += 1
        self.first.setdefault(kind, problem)

    def summary(self, total: int) -> list[tuple[str, str]]:
        return [
            (kind, f"{count} of {total}; the first: {self.first[kind]}")
            for kind, count in self.counts.items()
        ]


def read_keypoint_files(root: Path, index: RowIndex, key: Key, limit: int | None) -> IntervalFrames:
    """An interval as downloaded: one text file per row of the table of frames.

    Rows are put in the order of ``frame_id``, where the table has it, else of their time.

    Args:
        root: The set's folder.
        index: The table of frames.
        key: Speaker and interval.
        limit: Read only so many frames, evenly spread; None for all.
    """
    problems = _Problems()
    names = ("frame_id", "pose_dt", "pose_fn", "dataset", "video_fn", "video_link")
    table = index.rows(key, names)
    rows: list[tuple[float, float, str, str, str, str]] = []
    for frame, pose_dt, pose_fn, dataset, video, link in table:
        try:
            time, path = parse_time(pose_dt), below(pose_fn, "keypoints_simple")
            # Without frame ids, time orders.
            rows.append((float(frame) if frame else 0.0, time, path, dataset, video, link))
        except ValueError as error:
            problems.add("bad row", str(error))
    rows.sort(key=lambda row: row[:2])
    folder = root / key[0] / "keypoints_simple"
    times, keypoints = [], []
    for _, time, path, *_ in _spread(rows, limit):
        try:
            keypoints.append(parse_keypoints(_read_any(folder, path, ".txt", MAX_FILE_BYTES + 1)))
            times.append(time)
        except FileNotFoundError:
            problems.add("missing keypoints", f"no {folder / path}")
        except (OSError, ValueError) as error:
            problems.add("broken keypoints", f"{folder / path}: {error}")
    dataset, video, link = rows[0][3:] if rows else ("", "", "")
    return IntervalFrames(
        np.array(times),
        np.array(keypoints).reshape(-1, 2, COUNT),
        dataset,
        video,
        link,
        problems=problems.summary(len(table)),
    )


def read_samples(root: Path, index: RowIndex, key: Key, limit: int | None) -> IntervalFrames:
    """An interval put together again from the overlapping npz samples of ``train.csv``.

    Args:
        root: The set's folder.
        index: ``train.csv``.
        key: Speaker and interval.
        limit: Read only so many samples, evenly spread; None for all.
    """
    problems = _Problems()
    table = index.rows(key, ("start", "end", "pose_fn", "dataset", "video_fn"))
    rows: list[tuple[float, float, str, str, str]] = []
    for first, final, pose_fn, dataset, video in table:
        try:
            path = below(pose_fn, "npz")
            rows.append((parse_time(first), parse_time(final), path, dataset, video))
        except ValueError as error:
            problems.add("bad row", str(error))
    rows.sort(key=lambda row: row[:2])
    folder = root / key[0] / "train" / "npz"
    times: list[NDArray[np.float64]] = []
    keypoints: list[NDArray[np.float64]] = []
    pieces: list[tuple[float, NDArray[np.float32]]] = []
    last = -np.inf
    for start, end, path, *_ in _spread(rows, limit):
        try:
            pose, audio = _read_sample(_existing(folder, path, ".npz"))
        except FileNotFoundError:
            problems.add("missing samples", f"no {folder / path}")
            continue
        except (InputFileError, ValueError, OSError) as error:
            problems.add("broken samples", f"{folder / path}: {error}")
            continue
        at = np.linspace(start, end, len(pose))
        # Samples overlap; half a frame tells the next frame from the last.
        new = at > last + 0.5 * (end - start) / max(1, len(pose) - 1)
        times.append(at[new])
        keypoints.append(pose[new])
        pieces.append((start, audio))
        last = max(last, end)
    dataset, video = rows[0][3:] if rows else ("", "")
    return IntervalFrames(
        np.concatenate(times) if times else np.zeros(0),
        np.concatenate(keypoints) if keypoints else np.zeros((0, 2, COUNT)),
        dataset,
        video,
        sounds=pieces or None,
        problems=problems.summary(len(table)),
    )


def sound_of(
    pieces: Sequence[tuple[float, NDArray[np.float32]]], start_s: float, seconds: float
) -> NDArray[np.float32]:
    """A stretch of overlapping pieces of sound; silence where none of them is.

    Args:
        pieces: As `IntervalFrames.sounds`.
        start_s: Where it begins, seconds in the video.
        seconds: Its length.
    """
    origin = pieces[0][0]
    begin, count = round((start_s - origin) * SAMPLE_RATE), round(seconds * SAMPLE_RATE)
    sound = np.zeros(count, dtype=np.float32)
    for at, piece in pieces:
        first = int((at - origin) * SAMPLE_RATE + 1e-3) - begin
        inside = piece[max(0, -first) : max(0, count - first)]
        sound[max(0, first) : max(0, first) + len(inside)] = inside
    return sound


def frame_rate(times: NDArray[np.float64]) -> float:
    """14.985 (every second frame of a 29.97 fps video) or 15, by the usual spacing of frames.

    Raises:
        ValueError: The spacing is neither's within 2 %.
    """
    steps = np.diff(times)
    steps = steps[steps > 0]
    if len(steps) == 0:
        raise ValueError("it has no two frames at different times")
    usual = np.median(steps)
    measured = 1 / steps[np.abs(steps / usual - 1) < _RATE_TOLERANCE].mean()
    fps = min(VIDEO_FPS, key=lambda rate: abs(measured / rate - 1))
    if abs(measured / fps - 1) > _RATE_TOLERANCE:
        raise ValueError(f"its frames are at {measured:.3f} fps; expected 14.985 or 15")
    return fps


def split_at_gaps(times: NDArray[np.float64], fps: float) -> list[NDArray[np.int64]]:
    """Frame numbers of each gap-free stretch; a frame that repeats the last one's time is left out.

    A gap is anything but one frame's step, backwards ones included.
    """
    stretches: list[list[int]] = []
    for i, time in enumerate(times):
        steps = round((time - times[stretches[-1][-1]]) * fps) if stretches else None
        if steps == 0:
            continue
        if steps != 1 or len(stretches[-1]) == MAX_STRETCH_FRAMES:
            stretches.append([])
        stretches[-1].append(i)
    return [np.array(stretch, dtype=np.int64) for stretch in stretches]


def _spread(rows: list[_Row], limit: int | None) -> list[_Row]:
    if limit is None or len(rows) <= limit:
        return rows
    return [rows[int(i)] for i in np.linspace(0, len(rows) - 1, limit)]


def _existing(folder: Path, path: str, suffix: str) -> Path:
    for name in spellings(path, suffix):
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError


def _read_any(folder: Path, path: str, suffix: str, most: int) -> bytes:
    # Opening, not asking first: there are millions of these files.
    for name in spellings(path, suffix):
        try:
            with open_file(f"{folder}/{name}") as file:
                return file.read(most)
        except (FileNotFoundError, NotADirectoryError):
            continue
    raise FileNotFoundError


def _read_sample(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    with NpzReader(path) as reader:
        pose, audio = reader.info("pose"), reader.info("audio")
        if len(pose.shape) != 3 or not 2 <= pose.shape[0] <= _MAX_SAMPLE_FRAMES:
            raise ValueError(f"pose is {pose.shape}; expected (64, 2, 49 or 52)")
        if len(audio.shape) != 1 or audio.shape[0] > 2 * SAMPLE_RATE * pose.shape[0] / 15:
            raise ValueError(f"audio is {audio.shape} for {pose.shape[0]} frames")
        if pose.dtype.kind not in "fiu" or audio.dtype.kind != "f":
            raise ValueError(f"pose is {pose.dtype}, audio {audio.dtype}; expected numbers")
        waveform = reader.rows("audio", 0, audio.shape[0]).astype(np.float32)
        if not (np.abs(waveform) < 8).all():
            raise ValueError("its audio holds NaN, or floats beyond 8")
        return without_face(reader.rows("pose", 0, pose.shape[0])), np.clip(waveform, -1, 1)
