"""The 3-D extension of the Berkeley set: ``train_<speaker>_noduplication_data.npz`` and the others.

Each file holds ``body`` (n, frames, 165) at 15 fps and ``wav`` (n, samples) at 16 kHz. The 165
numbers are coordinate-major (55 x, 55 y, 55 z), metres, y down, and the joints of each hand are
relative to its wrist. Which way the axes point is measured on the file's own bodies, not assumed:
see `measure_conventions`.
"""

from __future__ import annotations

import functools
import logging
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped, Source, existing_folder
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.berkeley import LICENCE, SPLITS
from cospeech.formats.berkeley.hands3d import BERKELEY_3D, FILE_INDEX, FILE_JOINTS
from cospeech.formats.npz_file import NpzReader
from cospeech.motion.motion import Motion
from cospeech.speech.speech import SAMPLE_RATE, Speech

FPS = 15.0
CHUNK_SETS = ("matching", "pairs")
ITEMS_PER_SOURCE = 64
"""About 20 MB of audio and motion."""
MAX_ITEMS = 2_000_000
MAX_FRAMES = 4096

_FILE = re.compile(r"(train|dev|test)_([A-Za-z0-9-]+)(_noduplication)?_data\.npz")
_SAMPLED_ITEMS = 16
_FURTHEST_M = 100.0
_LOUDEST = 8.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Conventions:
    """How a file's bodies lie in space.

    Attributes:
        signs: Factors of x, y and z that give house axes: (1, -1, -1) for the camera's axes
            (x right, y down, z away) of a speaker who looks into it.
        hands_at_origin: Whether the joints of a hand are relative to its wrist.
    """

    signs: tuple[float, float, float] = (1.0, -1.0, -1.0)
    hands_at_origin: bool = True


def find_3d_sources(
    root: str | Path, *, chunks: str = "matching", speakers: Sequence[str] | None = None
) -> list[Source]:
    """Blocks of `ITEMS_PER_SOURCE` items of the files below a folder, or below its subfolders.

    Args:
        root: Folder with the ``*_data.npz`` files, or with one folder per speaker.
        chunks: ``"matching"``: the disjoint chunks (``_noduplication``); ``"pairs"``: the
            overlapping windows. The test file, which has no overlap, belongs to both.
        speakers: Only these; None for all there are.

    Raises:
        CospeechError: No file fits.
    """
    if chunks not in CHUNK_SETS:
        raise CospeechError(f"chunks={chunks!r}", hint=f"choose {' or '.join(CHUNK_SETS)}")
    found = list_3d_files(existing_folder(root))
    wanted = [
        (path, split, speaker)
        for path, split, speaker, disjoint in found
        if (split == "test" or disjoint == (chunks == "matching"))
        and (speakers is None or speaker in speakers)
    ]
    absent = sorted(set(speakers or ()) - {speaker for _, _, speaker in wanted})
    if absent or not any(split == "train" for _, split, _ in wanted):
        middle = "_noduplication" if chunks == "matching" else ""
        raise CospeechError(
            f"no train_{absent[0] if absent else '<speaker>'}{middle}_data.npz in {root} or its"
            f" folders; there are: {', '.join(path.name for path, *_ in found) or 'none'}",
            hint="point data.root at the folder of the speakers' npz files; data.chunks chooses"
            " matching (*_noduplication_data.npz) or pairs (the others), data.speakers who",
        )
    return [source for file in wanted for source in _file_sources(*file)]


def list_3d_files(root: str | Path) -> list[tuple[Path, str, str, bool]]:
    """(path, published split, speaker, without overlap) of every file of the extension."""
    root, found = Path(root), []
    for path in sorted([*root.glob("*_data.npz"), *root.glob("*/*_data.npz")]):
        if match := _FILE.fullmatch(path.name):
            found.append((path, match[1], match[2], match[3] is not None))
    return found


def _file_sources(path: Path, split: str, speaker: str) -> list[Source]:
    try:
        with NpzReader(path) as reader:
            count = _item_shape(reader)[0]
    except InputFileError:
        count = 0  # its only source raises the same error when its turn comes
    blocks = range(0, max(count, 1), ITEMS_PER_SOURCE)
    return [
        Source(
            f"{path.stem}-{start:06d}",
            functools.partial(
                read_items, str(path), speaker, SPLITS[split], start, start + ITEMS_PER_SOURCE
            ),
            (path,),
        )
        for start in blocks
    ]


def read_items(
    path: str, speaker: str, split: str, start: int, stop: int
) -> Iterator[Recording | Dropped]:
    """Items ``start`` to ``stop`` of a file, one recording each.

    Memory is one item's. A compressed file is unpacked up to the block; as the open file is kept
    for the process's next block, it is unpacked once per process.

    Args:
        path: The npz.
        speaker: Speaker name.
        split: ``"train"``, ``"val"`` or ``"test"``.
        start: First item.
        stop: One past the last; the file's end is respected.

    Yields:
        Motion of 55 joints (`hands3d.BERKELEY_3D`) in house axes and the audio of exactly its
        frames, 16 kHz.

    Raises:
        InputFileError: The file is broken or lacks an array.
    """
    state = Path(path).stat() if Path(path).exists() else None
    key = (0, 0) if state is None else (state.st_mtime_ns, state.st_size)
    reader, conventions = _opened(path, *key, os.getpid())
    count, frames, samples = _item_shape(reader)
    name = Path(path).name
    kind = "pairs" if "_noduplication" not in name and split != "test" else "matching"
    for item in range(start, min(stop, count)):
        recording_id = f"{speaker}-{split}-{item:06d}"
        body = reader.rows("body", item, item + 1)[0]
        waveform, problem = _waveform(reader.rows("wav", item, item + 1)[0], frames, samples)
        if not np.isfinite(body).all() or np.abs(body).max() > _FURTHEST_M:
            problem = "its positions hold NaN, or are over 100 m away"
        if problem is not None:
            place = f"{name}, item {item}: {problem}"
            yield Dropped(recording_id, place, "broken values", is_fault=True)
            continue
        yield Recording(
            id=recording_id,
            speaker=speaker,
            speech=Speech(waveform),
            motion=Motion(BERKELEY_3D, FPS, to_house_axes(body, conventions)),
            annotations={
                "item": item,
                "chunks": kind,
                "axes": list(conventions.signs),
                "hands_at_origin": conventions.hands_at_origin,
                **_images(reader, item),
            },
            split=split,
            source=f"{name}, item {item}",
            licence=LICENCE,
        )


def to_house_axes(body: NDArray[Any], conventions: Conventions) -> NDArray[np.float32]:
    """A file's ``(frames, 165)`` as ``(frames, 55, 3)`` positions on `hands3d.BERKELEY_3D`.

    Coordinate-major to joint-major, hands added to their wrists, axes to house axes.
    """
    points = _joint_major(body).astype(np.float32)
    if conventions.hands_at_origin:
        for side in ("r", "l"):
            wrist = points[:, FILE_JOINTS.index(f"{side}_wrist"), None].copy()
            first = FILE_JOINTS.index(f"{side}_hand")
            points[:, first : first + 21] += wrist
    return points[:, FILE_INDEX] * np.array(conventions.signs, dtype=np.float32)


def measure_conventions(bodies: NDArray[Any]) -> Conventions:
    """Which way a file's axes point, from the bodies themselves.

    Up is from the pelvis to the neck. The left shoulder is on +x, as speakers look more or less
    into the camera. The depth axis is chosen such that wrists are in front of their shoulders
    (front being left × up): in right-handed data that makes the change of axes a rotation, and a
    file whose depth is flipped is mended. Where wrists are not clearly in front or behind
    (2 cm in the median), data is taken as right-handed.

    Args:
        bodies: ``(items, frames, 165)``.
    """
    flat = bodies.reshape(-1, bodies.shape[-1])
    flat = flat[np.isfinite(flat).all(axis=1)]
    if len(flat) == 0:
        return Conventions()
    points = dict(zip(FILE_JOINTS, _joint_major(flat).swapaxes(0, 1).astype(float), strict=True))
    up = points["neck"] - points["pelvis"]
    left = points["l_shoulder"] - points["r_shoulder"]
    front = np.cross(left, up)
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-9)
    reach = sum(
        np.einsum("td,td->t", points[f"{side}_wrist"] - points[f"{side}_shoulder"], front)
        for side in ("l", "r")
    )
    handedness = -1.0 if np.median(reach) / 2 < -0.02 else 1.0
    sign_x = 1.0 if np.median(left[:, 0]) >= 0 else -1.0
    sign_y = 1.0 if np.median(up[:, 1]) > 0 else -1.0
    roots = [np.linalg.norm(points[f"{side}_hand"], axis=1) for side in ("l", "r")]
    return Conventions(
        signs=(sign_x, sign_y, handedness * sign_x * sign_y),
        hands_at_origin=bool(np.median(np.concatenate(roots)) < 0.01),
    )


def _joint_major(body: NDArray[Any]) -> NDArray[Any]:
    return body.reshape(-1, 3, len(FILE_JOINTS)).swapaxes(1, 2)


# One file at a time: a process reads its blocks in ascending order.
@functools.lru_cache(maxsize=1)
def _opened(path: str, modified: int, size: int, process: int) -> tuple[NpzReader, Conventions]:
    reader = NpzReader(path)
    count = _item_shape(reader)[0]
    conventions = measure_conventions(reader.rows("body", 0, min(count, _SAMPLED_ITEMS)))
    if conventions != Conventions():
        _log.warning(
            "%s: axes %s and hands %s wrists, measured on its bodies, are not the published ones"
            " (x right, y down, z away; hands relative to the wrists); they are converted",
            path,
            conventions.signs,
            "relative to" if conventions.hands_at_origin else "not relative to",
        )
    return reader, conventions


def _item_shape(reader: NpzReader) -> tuple[int, int, int]:
    """Items, frames and samples per item."""
    body, wav = reader.info("body"), reader.info("wav")
    if len(body.shape) != 3 or body.shape[2] != 3 * len(FILE_JOINTS) or body.dtype.kind != "f":
        raise InputFileError(
            reader.path,
            f"body is {body.shape} of {body.dtype}; expected (items, frames, 165) of floats",
        )
    count, frames = body.shape[:2]
    if not 2 <= frames <= MAX_FRAMES or not 1 <= count <= MAX_ITEMS:
        raise InputFileError(reader.path, f"holds {count} items of {frames} frames")
    expected = round(frames / FPS * SAMPLE_RATE)
    if len(wav.shape) != 2 or wav.shape[0] != count or wav.dtype.str[1:] not in _AUDIO_TYPES:
        raise InputFileError(
            reader.path,
            f"wav is {wav.shape} of {wav.dtype}; expected ({count}, samples) of floats or int16",
        )
    if abs(wav.shape[1] - expected) > 0.1 * expected:
        raise InputFileError(
            reader.path,
            f"wav has {wav.shape[1]} samples per item; {frames} frames at 15 fps are {expected} at"
            " 16 kHz",
        )
    return count, frames, wav.shape[1]


_AUDIO_TYPES = ("f2", "f4", "f8", "i2")


def _waveform(
    values: NDArray[Any], frames: int, samples: int
) -> tuple[NDArray[np.float32], str | None]:
    """The audio of the frames, and what is wrong with it."""
    waveform = np.zeros(round(frames / FPS * SAMPLE_RATE), dtype=np.float32)
    length = min(samples, len(waveform))
    waveform[:length] = values[:length]
    if values.dtype.kind == "i":
        return waveform / np.float32(32768), None
    if not np.isfinite(waveform).all():
        return waveform, "its audio holds NaN or infinite samples"
    if np.abs(waveform).max() > _LOUDEST:
        return waveform, "its float audio goes beyond 8, where full scale is 1"
    return np.clip(waveform, -1.0, 1.0, out=waveform), None


def _images(reader: NpzReader, item: int) -> dict[str, str]:
    """First and last frame's picture name, where ``imgs`` is plain text."""
    if "imgs" not in reader.names:
        return {}
    try:
        info = reader.info("imgs")
        if len(info.shape) != 2 or info.dtype.kind not in "US" or info.row_bytes > 2**22:
            return {}
        names = reader.rows("imgs", item, item + 1)[0][[0, -1]]
    except (InputFileError, ValueError, IndexError):
        return {}
    first, last = (
        name.decode("latin1") if isinstance(name, bytes) else str(name) for name in names
    )
    return {"first_image": first, "last_image": last}
