"""The 2-D Berkeley set as downloaded: a table of frames and one keypoint file per frame.

Where a speaker has no ``keypoints_simple`` folder, the samples that the published extraction makes
(``train.csv`` and ``<speaker>/train/npz``) are put together again instead.
"""

from __future__ import annotations

import functools
import logging
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped, Source, existing_folder
from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import open_file
from cospeech.formats.berkeley import LICENCE, SPLITS
from cospeech.formats.berkeley.audio import find_audio, read_audio
from cospeech.formats.berkeley.interval_frames import (
    FRAME_COLUMNS,
    SAMPLE_COLUMNS,
    IntervalFrames,
    frame_rate,
    read_keypoint_files,
    read_samples,
    sound_of,
    split_at_gaps,
)
from cospeech.formats.berkeley.keypoints import BERKELEY_2D, to_house_axes
from cospeech.formats.berkeley.layout import (
    FRAME_TABLES,
    INTERVAL_TABLE,
    LINK_TABLES,
    SAMPLE_TABLE,
    first_existing,
    parse_time,
    recording_name,
)
from cospeech.formats.berkeley.published2d import JON_SHOULDER_PX, WINDOW_FRAMES, training_windows
from cospeech.formats.berkeley.rows import Key, RowIndex, index_rows, read_small_table
from cospeech.motion.motion import Motion
from cospeech.speech.speech import SAMPLE_RATE, Speech

TABLE_BYTES_PER_SOURCE = 1_000_000
"""About 4,000 rows: 4.5 minutes, 20 MB of audio and keypoints."""

_SCALE_INTERVALS = 64
_SCALE_FRAMES = 4
_Reader = Callable[[Path, RowIndex, Key, int | None], IntervalFrames]
_LAYOUTS: dict[str, tuple[_Reader, tuple[str, ...]]] = {
    "keypoints": (read_keypoint_files, FRAME_COLUMNS),
    "samples": (read_samples, SAMPLE_COLUMNS),
}

_log = logging.getLogger(__name__)


def find_2d_sources(root: str | Path, *, speakers: Sequence[str] | None = None) -> list[Source]:
    """Each speaker's intervals, dealt evenly over sources by a checksum of their names.

    No table is read for it: how many sources there are follows from the table's size, so
    training on a prepared set starts at once. Keypoint files are millions and are not listed in
    `Source.files`; the tables and the folder of videos stand for them.

    Args:
        root: The folder with the table of frames and one folder per speaker.
        speakers: Only these; None for all whose files are there.

    Raises:
        CospeechError: There is nothing of the set, or not of a speaker asked for.
    """
    root = existing_folder(root)
    frames, samples = first_existing(root, FRAME_TABLES), root / SAMPLE_TABLE
    layouts: dict[str, tuple[str, Path, Path]] = {}
    for folder in sorted(path for path in root.glob("*") if path.is_dir()):
        keypoints, extracted = folder / "keypoints_simple", folder / "train" / "npz"
        if frames is not None and keypoints.is_dir():
            layouts[folder.name] = ("keypoints", frames, keypoints)
        elif samples.is_file() and extracted.is_dir():
            layouts[folder.name] = ("samples", samples, extracted)
    wanted = sorted(layouts) if speakers is None else list(speakers)
    absent = [speaker for speaker in wanted if speaker not in layouts]
    if absent or not wanted:
        tables = ", ".join(FRAME_TABLES)
        above = first_existing(root.resolve().parent, (*FRAME_TABLES, SAMPLE_TABLE))
        raise CospeechError(
            f"no keypoints of {', '.join(absent) or 'any speaker'} in {root}: it has"
            f" {'the table ' + frames.name if frames else f'none of the tables {tables}'},"
            f" {'' if samples.is_file() else 'no '}{SAMPLE_TABLE}, and"
            f" {'files of ' + ', '.join(layouts) if layouts else 'no files of speakers'}",
            hint=f"set data.root to the folder above, where {above.name} is"
            if above is not None and not layouts
            else "data.root is the folder with the table of frames and, per speaker,"
            f" <speaker>/keypoints_simple (or {SAMPLE_TABLE} and <speaker>/train/npz)",
        )
    sources = []
    others = [first_existing(root, LINK_TABLES), first_existing(root, (INTERVAL_TABLE,))]
    for speaker in wanted:
        layout, table, folder = layouts[speaker]
        shares = -(-table.stat().st_size // (TABLE_BYTES_PER_SOURCE * len(layouts))) or 1
        files = (table, *(path for path in others if path is not None), folder)
        sources += [
            Source(
                f"{speaker}-{share + 1:04d}-of-{shares:04d}",
                functools.partial(
                    read_intervals, str(root), layout, str(table), speaker, share, shares
                ),
                files,
            )
            for share in range(shares)
        ]
    return sources


def read_intervals(
    root: str, layout: str, table: str, speaker: str, share: int, shares: int
) -> Iterator[Recording | Dropped]:
    """One share of a speaker's intervals: one recording per gap-free stretch of 65 frames or more.

    Args:
        root: The set's folder.
        layout: ``"keypoints"`` or ``"samples"``.
        table: The table of frames, or ``train.csv``.
        speaker: Speaker name.
        share: Which share.
        shares: How many shares there are.

    Yields:
        Motion on `keypoints.BERKELEY_2D`: pixels of the source video relative to the neck, x to
        the picture's right (the speaker's left), y up; 14.985 or 15 fps; with the published
        windows, split and whatever audio there is.

    Raises:
        InputFileError: The table can't be used.
    """
    folder = Path(root)
    read, columns = _LAYOUTS[layout]
    index = index_rows(Path(table), columns)
    if index.bad_rows and share == 0:
        yield Dropped(
            f"{speaker}: rows",
            f"{index.bad_rows} rows of {index.path} have another number of fields than its header;"
            f" the first is line {index.first_bad}",
            "bad row",
            is_fault=True,
        )
    mine = [
        key
        for key in index.runs
        if key[0] == speaker and zlib.crc32(key[1].encode()) % shares == share
    ]
    if not any(key[0] == speaker for key in index.runs):
        raise InputFileError(index.path, f"has no row of the speaker {speaker}")
    silent = 0
    for key in mine:
        name = recording_name(*key)
        try:
            frames = read(folder, index, key, None)
        except CospeechError as error:
            yield Dropped(name, str(error), "unreadable interval", is_fault=True)
            continue
        for kind, problem in frames.problems:
            yield Dropped(name, problem, kind, is_fault=True)
        heard = 0
        for item in _recordings(folder, key, name, frames, _scale_factor(folder, layout, speaker)):
            heard += isinstance(item, Dropped) or len(item.speech.waveform) > 0
            yield item
        silent += not heard
    if silent:
        yield Dropped(
            f"{speaker}: audio",
            f"{silent} of {len(mine)} intervals of {speaker} have no audio: there is no"
            f" {speaker}/train/audio/<interval>-<start>-<end>.wav, {speaker}/audio/<video>.wav or"
            f" {speaker}/videos/<video>.wav of them; their motion is kept",
            "no audio",
        )


def _recordings(
    root: Path, key: Key, name: str, frames: IntervalFrames, scale: float | None
) -> Iterator[Recording | Dropped]:
    if len(frames.times) == 0:
        yield Dropped(name, "it has no frame that can be read", "empty interval")
        return
    try:
        fps = frame_rate(frames.times)
    except ValueError as error:
        yield Dropped(name, str(error), "frame rate", is_fault=True)
        return
    for number, stretch in enumerate(split_at_gaps(frames.times, fps)):
        part = name if number == 0 else f"{name}-part{number + 1}"
        if len(stretch) <= WINDOW_FRAMES:
            yield Dropped(
                part,
                f"{len(stretch)} frames without a gap; a published window needs"
                f" {WINDOW_FRAMES + 1}",
                "short stretch",
            )
            continue
        start, keypoints = float(frames.times[stretch[0]]), frames.keypoints[stretch]
        duration = len(stretch) / fps
        annotations = _annotations(root, key, frames, keypoints, start, scale)
        try:
            waveform, warning = _audio(root, key, frames, start, duration)
        except InputFileError as error:
            yield Dropped(f"{part}: audio", str(error), "broken audio", is_fault=True)
            waveform, warning = np.zeros(0, dtype=np.float32), None
        if warning is not None:
            annotations["warnings"] = [warning]
        yield Recording(
            id=part,
            speaker=key[0],
            speech=Speech(waveform),
            motion=Motion(BERKELEY_2D, fps, to_house_axes(keypoints)),
            annotations=annotations,
            split=SPLITS.get(frames.dataset.lower()),
            source=f"{frames.video} at {start:.3f} s",
            licence=LICENCE,
            windows=training_windows(len(stretch), fps),
        )


def _annotations(
    root: Path,
    key: Key,
    frames: IntervalFrames,
    keypoints: NDArray[np.float64],
    start: float,
    scale: float | None,
) -> dict[str, Any]:
    values: dict[str, Any] = {
        "interval": key[1],
        "video": frames.video,
        "start_s": start,
        "neck_px": [round(float(x), 1) for x in np.median(keypoints[:, :, 0], axis=0)],
        "scale_factor": scale,
        # OpenPose puts what it didn't find at the picture's corner.
        "points_at_origin": float((keypoints == 0).all(axis=1).mean()),
    }
    if link := frames.link or _links(root).get((key[0], frames.video), ""):
        values["link"] = link
    if bounds := _interval_bounds(root).get(key):
        values["interval_s"] = list(bounds)
    return values


def _audio(
    root: Path, key: Key, frames: IntervalFrames, start: float, duration: float
) -> tuple[NDArray[np.float32], str | None]:
    if frames.sounds is not None:
        return sound_of(frames.sounds, start, duration), None
    audio = find_audio(root, key[0], key[1], frames.video)
    if audio is None:
        return np.zeros(0, dtype=np.float32), None
    waveform, found = read_audio(audio, start, duration)
    # The published files end with the last frame's time, one frame before its end.
    absent = duration - found / SAMPLE_RATE
    if absent <= 0.1:
        return waveform, None
    warning = f"{audio.path.name} has no sound for {absent:.2f} s of {duration:.2f} s: zeros"
    _log.warning("%s: %s", key[1], warning)
    return waveform, warning


# Facts of the set that every interval asks for; a process reads them once.
@functools.lru_cache(maxsize=2)
def _links(root: Path) -> dict[tuple[str, str], str]:
    path = first_existing(root, LINK_TABLES)
    if path is None:
        return {}
    # The link is the last of the three columns, whatever it is called.
    with open_file(path) as file:
        first = file.readline(2**16).decode("utf-8-sig", "replace")
    header = first.strip().split(",")
    rows = read_small_table(path, ("speaker", "video_fn", header[-1].strip('" ')))
    return {(speaker, video): link for speaker, video, link in rows}


@functools.lru_cache(maxsize=2)
def _interval_bounds(root: Path) -> dict[Key, tuple[float, float]]:
    path = first_existing(root, (INTERVAL_TABLE,))
    bounds: dict[Key, tuple[float, float]] = {}
    if path is None:
        return bounds
    names = ("speaker", "interval_id", "start_time", "end_time")
    for speaker, interval, start, end in read_small_table(path, names):
        try:
            bounds[speaker, interval] = parse_time(start), parse_time(end)
        except ValueError:
            continue
    return bounds


def _scale_factor(root: Path, layout: str, speaker: str) -> float | None:
    own = _shoulder_distance(root, layout, speaker)
    jon = JON_SHOULDER_PX
    if (root / "jon" / ("keypoints_simple" if layout == "keypoints" else "train/npz")).is_dir():
        jon = _shoulder_distance(root, layout, "jon") or jon
    return None if not own else jon / own


@functools.lru_cache(maxsize=32)
def _shoulder_distance(root: Path, layout: str, speaker: str) -> float | None:
    """Horizontal shoulder distance of a speaker's mean pose, pixels.

    Of some 256 training frames spread evenly over the speaker's intervals: reading all of them
    first would double the time.
    """
    read, columns = _LAYOUTS[layout]
    table = first_existing(root, FRAME_TABLES) if layout == "keypoints" else root / SAMPLE_TABLE
    if table is None:
        return None
    index = index_rows(table, columns)
    keys = sorted(key for key in index.runs if key[0] == speaker)
    chosen = np.unique(np.linspace(0, len(keys) - 1, min(len(keys), _SCALE_INTERVALS)).astype(int))
    poses = []
    for i in chosen:
        try:
            frames = read(root, index, keys[i], _SCALE_FRAMES)
        except CospeechError:
            continue
        if frames.dataset == "train":
            poses.append(frames.keypoints)
    if not poses or sum(map(len, poses)) == 0:
        return None
    shoulders = np.concatenate(poses)[:, 0, :].mean(axis=0)
    index_of = BERKELEY_2D.index
    distance = shoulders[index_of["left_shoulder"]] - shoulders[index_of["right_shoulder"]]
    return float(abs(distance)) or None
