"""The TED Gesture set as published: LMDB folders of videos, or of the samples cached from them.

``lmdb_train``, ``lmdb_val`` and ``lmdb_test`` hold one value per video, with the clips in it; the
same names with ``_cache`` hold the 42-frame samples that the published code makes of them. Either
becomes recordings with the published list of windows; TED-Expressive is told apart by its joints.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped, Source, existing_folder
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.lmdb_values import list_keys, read_value
from cospeech.formats.ted.clip import UnusableClipError, ValueLayoutError
from cospeech.formats.ted.filters import PUBLISHED_RULES, WindowRules
from cospeech.formats.ted.recordings import Origin, clip_recordings, sample_recording
from cospeech.formats.ted.values import checked_clip, checked_sample, video_clips, words_of

DATABASES = {"train": "lmdb_train", "val": "lmdb_val", "test": "lmdb_test"}
KINDS = ("auto", "video", "cache")
SAMPLES_PER_SOURCE = 256


def find_ted_sources(
    root: str | Path, *, kind: str = "auto", rules: WindowRules | None = PUBLISHED_RULES
) -> list[Source]:
    """The videos, or blocks of cached samples, of the databases in a folder.

    Args:
        root: The folder that holds ``lmdb_train`` and the others.
        kind: ``"video"``, ``"cache"`` (the folders with ``_cache``), or ``"auto"``: of each split
            the videos if they are there, else the cached samples.
        rules: What windows the recordings list; None leaves every window of a video open.

    Raises:
        ConfigError: ``kind`` is none of the three.
        CospeechError: There is no such folder, or it has no such database.
        InputFileError: A database is damaged.
    """
    if kind not in KINDS:
        raise ConfigError(f"data.kind={kind}: choose one of {', '.join(KINDS)}")
    root = existing_folder(root)
    sources = []
    for split, name in DATABASES.items():
        video, cache = root / name, root / f"{name}_cache"
        if kind != "cache" and (video / "data.mdb").is_file():
            sources += _video_sources(video, split, rules)
        elif kind != "video" and (cache / "data.mdb").is_file():
            sources += _sample_sources(cache, split)
    if not sources:
        wanted = {"auto": ("", "_cache"), "video": ("",), "cache": ("_cache",)}[kind]
        names = ", ".join(f"{name}{end}/data.mdb" for end in wanted for name in DATABASES.values())
        hint = "set data.root to the folder of the downloaded lmdb_train, lmdb_val and lmdb_test"
        if (root / "data.mdb").is_file():
            hint = f"{root} is itself a database: set data.root to the folder above it"
        elif below := sorted(path.parent.parent for path in root.glob("*/lmdb_*/data.mdb")):
            hint = f"set data.root to its subfolder {below[0].name}"
        raise CospeechError(f"no TED database in {root}: looked for {names}", hint)
    return sources


def _video_sources(database: Path, split: str, rules: WindowRules | None) -> list[Source]:
    return [
        Source(
            f"{database.name}/{_text(key)}",
            partial(read_video, database, key, split, rules),
            (database / "data.mdb",),
        )
        for key in list_keys(database)
    ]


def _sample_sources(database: Path, split: str) -> list[Source]:
    keys = list_keys(database)
    blocks = [keys[i : i + SAMPLES_PER_SOURCE] for i in range(0, len(keys), SAMPLES_PER_SOURCE)]
    return [
        Source(
            f"{database.name}/{_text(block[0])}",
            partial(read_samples, database, tuple(block), split),
            (database / "data.mdb",),
        )
        for block in blocks
    ]


def read_video(
    database: Path,
    key: bytes,
    split: str | None = None,
    rules: WindowRules | None = PUBLISHED_RULES,
) -> Iterator[Recording | Dropped]:
    """The clips of one video as recordings; `Dropped` for those that give none.

    Args:
        database: The database's folder.
        key: The video's key.
        split: Split of the recordings.
        rules: What windows they list; None: any window may be used.

    Raises:
        InputFileError: The value can't be decoded, is no video, or has unknown joints.
    """
    place = f"key {_text(key)}"
    try:
        video, clips = video_clips(read_value(database, key))
        if not clips:
            empty = Origin(_safe(video), video, split, f"{database.name}, {place}")
            yield empty.dropped("the video has no clips", "no clip")
        for index, values in enumerate(clips):
            place = f"key {_text(key)}, clip {index}"
            origin = Origin(_safe(f"{video}_{index}"), video, split, f"{database.name}, {place}")
            try:
                yield from clip_recordings(checked_clip(values), origin, rules)
            except UnusableClipError as error:
                words = words_of(values)
                yield origin.dropped(str(error), error.kind, is_fault=True, words=words)
    except ValueLayoutError as error:
        raise InputFileError(database, str(error), place) from error


def read_samples(
    database: Path, keys: tuple[bytes, ...], split: str | None = None
) -> Iterator[Recording | Dropped]:
    """Cached samples, each a recording with one window that covers it; `Dropped` for damaged ones.

    Args:
        database: The database's folder.
        keys: The samples' keys.
        split: Split of the recordings.

    Raises:
        InputFileError: A value is no cached sample, or has unknown joints.
    """
    for key in keys:
        place = f"key {_text(key)}"
        unnamed = Origin(f"{database.name}-{_safe(_text(key))}", "", split, database.name)
        try:
            yield _sample(database, key, split)
        except ValueLayoutError as error:
            raise InputFileError(database, str(error), place) from error
        except InputFileError as error:
            yield unnamed.dropped(str(error), "damaged", is_fault=True)
        except UnusableClipError as error:
            yield unnamed.dropped(f"{place}: {error}", error.kind, is_fault=True)


def _sample(database: Path, key: bytes, split: str | None) -> Recording | Dropped:
    sample = checked_sample(read_value(database, key))
    video = sample.aux["vid"]
    place = f"{database.name}, key {_text(key)}"
    origin = Origin(_safe(f"{video}_{_text(key)}"), video, split, place)
    if sample.aux.get("is_correct_motion") is False:
        message = f"marked {sample.aux.get('filtering_message')!r}"
        return origin.dropped(message, "marked as incorrect motion", words=sample.words)
    return sample_recording(sample, origin)


def _safe(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]", "_", name)


def _text(key: bytes) -> str:
    return key.decode("ascii", "backslashreplace")
