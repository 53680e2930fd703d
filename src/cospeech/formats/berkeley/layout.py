"""Names of the 2-D set: its tables, its times, its paths."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from pathlib import Path

FRAME_TABLES = ("frames_df_10_19_19.csv", "frames.csv", "frames_df_2_16_19.csv")
"""Names of the table of frames, in order of preference."""
LINK_TABLES = ("videos_links.csv", "video_links.csv")
INTERVAL_TABLE = "intervals_df.csv"
SAMPLE_TABLE = "train.csv"

_VIDEO_SUFFIX = re.compile(r"\.(mp4|webm|mkv)$", re.IGNORECASE)
_TIME = re.compile(
    r"(?:(\d{1,2}) days? |\d{4}-\d\d-\d\d[ T])?(\d{1,2})[:_](\d\d)[:_](\d\d)([.,]\d{1,9})?"
)


def first_existing(root: Path, names: tuple[str, ...]) -> Path | None:
    """The first of several names that is a file in a folder."""
    return next((root / name for name in names if (root / name).is_file()), None)


def video_stem(video: str) -> str:
    """A video's name without its container: only a last ``.mp4``, ``.webm`` or ``.mkv`` goes.

    Names such as ``2._History_of_x.vs._pH.mkv`` have dots of their own.
    """
    return _VIDEO_SUFFIX.sub("", video)


def parse_time(text: str) -> float:
    """Seconds of ``HH:MM:SS[.ffffff]``, as ``pose_dt`` and file names write them.

    A leading date or ``0 days`` (pandas) and ``_`` for ``:`` (Windows) are understood.

    Raises:
        ValueError: It is no time.
    """
    match = _TIME.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text[:60]!r} is no time HH:MM:SS[.ffffff]")
    days, hours, minutes, seconds, fraction = match.groups()
    whole = ((int(days or 0) * 24 + int(hours)) * 60 + int(minutes)) * 60 + int(seconds)
    return whole + float((fraction or ".0").replace(",", "."))


def below(value: str, marker: str) -> str:
    """A path of the tables as it is below a folder called ``marker``.

    Tables hold relative paths or absolute ones of another machine: what follows the last
    ``marker`` counts; of an absolute path without it, folder and file name.

    Raises:
        ValueError: It is empty or climbs out of the folder.
    """
    path = value.strip()
    is_absolute = path.startswith("/")
    if path[1:3] == ":\\":
        path, is_absolute = path.replace("\\", "/"), True
    parts = [part for part in path.split("/") if part and part != "."]
    if marker in parts:
        parts = parts[len(parts) - parts[::-1].index(marker) :]
    elif is_absolute:
        parts = parts[-2:]
    if not parts or ".." in parts or "\0" in path:
        raise ValueError(f"{value[:120]!r} is no path in the folder {marker}")
    return "/".join(parts)


def spellings(path: str, suffix: str) -> Iterator[str]:
    """How a file of the tables may be called on disk.

    With its suffix where the table leaves it out, as written, and with ``_`` for ``:``, which
    Windows has no name with.
    """
    names = [path] if path.endswith(suffix) else [path + suffix, path]
    for name in names:
        yield name
        if ":" in name:
            yield name.replace(":", "_")


def recording_name(speaker: str, interval: str) -> str:
    """``speaker-interval`` in the letters that an id may have; what was lost, as a checksum."""
    text = f"{speaker}-{interval}"
    safe = re.sub(r"[^A-Za-z0-9_.-]", "_", text)
    return safe if safe == text else f"{safe}-{zlib.crc32(text.encode('utf-8', 'replace')):08x}"
