"""The UCI Gesture Phase Segmentation set: seven Kinect recordings with phases (Madeo et al. 2013).

The ``*_raw.csv`` files are read, not the processed ``*_va3.csv``, whose velocities mix units and
have the wrong sign. As measured on the files:

* Sampling is irregular (26 to 30 fps, gaps up to 0.44 s): positions are put on 60 fps by linear
  interpolation in time, and a frame has the phase of the row nearest in time.
* x and y are scaled (5 units per metre around 5; in one file 0.5), z is metres. The scale is found
  from the data: the distance between head and spine is a person's.
* x points to the speaker's right, y down, z away from the camera, which the speaker faces.
* Coordinates at the picture's edge are clipped to 0: they are interpolated from the rows around.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Source, existing_folder
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.uci_table import FILE_JOINTS, UciTable, read_uci_table
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.speech.speech import Speech

UCI_SKELETON = Skeleton(
    name="uci",
    joints=("spine", "head", "left_wrist", "left_hand", "right_wrist", "right_hand"),
    parents=(-1, 0, 0, 2, 0, 4),
)
"""What the Kinect saw; no elbows, so the wrists hang on the spine."""

FPS = 60.0
"""Rate of the resampled motion: three interleaved motions of 20 fps."""

LICENCE = "CC BY 4.0 (UCI Machine Learning Repository, Gesture Phase Segmentation)"

_NAME = re.compile(r"([a-z])(\d)_raw\.csv", re.IGNORECASE)
_ORIGIN = 5.0
_SCALES = (5.0, 0.5)
_SPINE_TO_HEAD_M = (0.3, 0.75)
_LONG_GAP_S = 0.1


def find_uci_sources(root: str | Path, protocol: str, held_out: str) -> list[Source]:
    """One source per ``*_raw.csv``, with the split of the protocol.

    Args:
        root: The folder of the csv files.
        protocol: See `uci_splits`.
        held_out: See `uci_splits`.

    Raises:
        CospeechError: There is no such folder, or it holds no such file.
        ConfigError: The protocol is unknown, or there is nothing of that name to hold out.
    """
    root = existing_folder(root)
    found = sorted(path for path in root.glob("*_raw.csv") if _NAME.fullmatch(path.name))
    if not found:
        below = sorted({path.parent.name for path in root.glob("*/*_raw.csv")})
        raise CospeechError(
            f"no file such as a1_raw.csv in {root}",
            f"set data.root to its subfolder {below[0]}"
            if below
            else "download 'Gesture Phase Segmentation' from the UCI Machine Learning Repository,"
            " unpack it and set data.root to the folder of its csv files",
        )
    splits = uci_splits([_video(path) for path in found], protocol, held_out)
    return [
        Source(
            _video(path),
            functools.partial(read_uci_recording, str(path), splits[_video(path)]),
            (path,),
        )
        for path in found
    ]


def uci_splits(videos: list[str], protocol: str, held_out: str) -> dict[str, str]:
    """Which video trains, validates and tests.

    Args:
        videos: Names such as ``"a3"``: the user's letter and the story's digit.
        protocol: ``"leave_user_out"``: all videos of ``held_out`` (``"c"``) test.
            ``"leave_video_out"``: the one video ``held_out`` (``"a3"``) tests.
        held_out: A user or a video.

    Returns:
        Video -> ``"train"``, ``"val"`` or ``"test"``. Of the rest, the last video of the user who
        has most (the first such user) validates; everything else trains.

    Raises:
        ConfigError: The protocol is unknown, there is nothing of that name, or too little is left.
    """
    if protocol not in ("leave_user_out", "leave_video_out"):
        raise ConfigError(f"data.protocol={protocol}: choose leave_user_out or leave_video_out")
    by_user = protocol == "leave_user_out"
    names = {video: video[0] if by_user else video for video in videos}
    if held_out not in names.values():
        there = ", ".join(sorted(set(names.values())))
        raise ConfigError(
            f"data.held_out={held_out}: with data.protocol={protocol} there are {there}"
        )
    rest = sorted(video for video in videos if names[video] != held_out)
    if len(rest) < 2:
        raise ConfigError(
            f"without {held_out} only {len(rest)} video is left, for training and validation",
            "get the other files of the set",
        )
    users = [video[0] for video in rest]
    most = max(sorted(set(users)), key=users.count)
    validates = max(video for video in rest if video[0] == most)
    splits = dict.fromkeys(videos, "test") | dict.fromkeys(rest, "train")
    return splits | {validates: "val"}


def read_uci_recording(path: str, split: str | None = None) -> Iterator[Recording]:
    """The recording of one raw file; the speaker is the user's letter.

    ``annotations`` hold the story, the scale found, how many rows and clipped values there were
    and the gaps in the sampling longer than 0.1 s, as (start, end) in seconds.

    Args:
        path: The file, named as published.
        split: Kept with the recording.

    Raises:
        InputFileError: The file isn't a raw file of the set, or its scale can't be found.
    """
    file = Path(path)
    table = read_uci_table(file)
    values, clipped = _unclipped(table)
    scale = _scale(file, values)
    metres = (values - [_ORIGIN, _ORIGIN, 0.0]) / [-scale, -scale, -1.0]
    metres = metres[:, [FILE_JOINTS.index(joint) for joint in UCI_SKELETON.joints]]
    times = table.times_s - table.times_s[0]
    frames = int(np.floor(times[-1] * FPS + 1e-6)) + 1
    frame_times = np.arange(frames) / FPS
    positions = np.stack(
        [np.interp(frame_times, times, column) for column in metres.reshape(len(times), -1).T],
        axis=1,
    )
    nearest = np.searchsorted((times[1:] + times[:-1]) / 2, frame_times, side="right")
    gaps = np.flatnonzero(np.diff(times) > _LONG_GAP_S)
    annotations: dict[str, Any] = {
        "story": int(_video(file)[1]),
        "rows": len(times),
        "units_per_metre": scale,
        "clipped": clipped,
        "gaps_s": [[round(float(times[i]), 3), round(float(times[i + 1]), 3)] for i in gaps],
    }
    yield Recording(
        id=_video(file),
        speaker=_video(file)[0],
        speech=Speech(np.zeros(0, dtype=np.float32), None),
        motion=Motion(UCI_SKELETON, FPS, positions.reshape(frames, -1, 3).astype(np.float32)),
        phases=table.labels[nearest],
        annotations=annotations,
        split=split,
        source=file.name,
        licence=LICENCE,
    )


def _unclipped(table: UciTable) -> tuple[NDArray[np.float64], dict[str, int]]:
    """Values with those at the picture's edge interpolated, and how many there were by column."""
    values = table.values.copy()
    counts = {}
    for joint, axis in np.ndindex(6, 2):
        column = values[:, joint, axis]
        clipped = column <= 0
        if clipped.any() and not clipped.all():
            known = ~clipped
            column[clipped] = np.interp(table.times_s[clipped], table.times_s[known], column[known])
            counts[f"{FILE_JOINTS[joint]} {'xy'[axis]}"] = int(clipped.sum())
    return values, counts


def _scale(path: Path, values: NDArray[np.float64]) -> float:
    """Units of x and y per metre: the one with which the head is as far from the spine as it is."""
    across = values[:, FILE_JOINTS.index("head")] - values[:, FILE_JOINTS.index("spine")]
    lengths = {
        scale: float(np.median(np.linalg.norm(across / [scale, scale, 1.0], axis=1)))
        for scale in _SCALES
    }
    low, high = _SPINE_TO_HEAD_M
    fitting = [scale for scale, length in lengths.items() if low < length < high]
    if len(fitting) != 1:
        listed = ", ".join(f"{length:.3g} m at {scale:g}" for scale, length in lengths.items())
        raise InputFileError(
            path, f"the scale of x and y can't be found: head to spine is {listed} units per metre"
        )
    return fitting[0]


def _video(path: Path) -> str:
    match = _NAME.fullmatch(path.name)
    if match is None:
        raise InputFileError(path, "not named as published (a1_raw.csv)")
    return (match[1] + match[2]).lower()
