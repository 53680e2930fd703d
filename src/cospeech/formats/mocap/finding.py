"""Finding takes: files belong together when their stems are equal."""

from __future__ import annotations

import logging
import os
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from cospeech.corpus.source import existing_folder
from cospeech.errors import ConfigError, CospeechError
from cospeech.foreign import linear_pattern
from cospeech.formats.mocap.takes import Take
from cospeech.speech.audio_streams import (
    AUDIO_SUFFIXES,
    DIRECT_SUFFIXES,
    PACKED_SUFFIXES,
    VIDEO_SUFFIXES,
)

TRANSCRIPT_SUFFIXES = (".textgrid", ".json", ".tsv", ".ctm", ".srt", ".vtt", ".txt")
"""In order of preference, when a take has several; the next is tried where one can't be used."""
PHASE_SUFFIXES = (".anvil", ".eaf", ".phases.csv")
MAX_FILES = 1_000_000

_log = logging.getLogger(__name__)

MissingAudio: TypeAlias = Literal["auto", "skip", "silence"]

_ROLE = re.compile(
    r"audios?|wavs?|wave|speech|sound|motions?|bvhs?|mocap|transcripts?|texts?|txt|tsv|json|textgrids?"
    r"|phases?|annotations?",
    re.IGNORECASE,
)
_Key: TypeAlias = tuple[tuple[str, ...], str]
_Kinds: TypeAlias = dict[str, list[Path]]


def find_takes(
    root: str | Path,
    *,
    speaker: str = "folder",
    missing_audio: MissingAudio = "skip",
    transcripts: Sequence[str] = TRANSCRIPT_SUFFIXES,
) -> list[Take]:
    r"""The takes below a folder, by their paths alone: no file is opened.

    Args:
        root: The folder, searched with all its subfolders; hidden files and folders are left out.
        speaker: Where a take's speaker is named. ``"folder"``: the nearest folder above the file
            that isn't one of the ``Audio``/``Motion`` kind, at last ``root`` itself. ``"prefix"``:
            the file name up to its first ``_`` or ``-``. Else a `linear_pattern` with a group,
            searched in the path below ``root``: ``"^(\w+)/"``, ``"_(?P<speaker>[a-z]+)_"``.
        missing_audio: What becomes of motion without audio. ``"skip"``: it has a ``problem``.
            ``"silence"``: it is read with silence of its length. ``"auto"``: silence in a folder
            without any file that may hold sound, read or not, else skip.
        transcripts: Suffixes of transcripts, the preferred first.

    Returns:
        Takes sorted by id. One that can't be used is listed with its ``problem``.

    Raises:
        CospeechError: The folder is absent, holds no BVH or audio at all, or an argument is none of
            its choices.
    """
    root = Path(root)
    if missing_audio not in get_args(MissingAudio):
        raise ConfigError(f"missing_audio={missing_audio}: choose auto, skip or silence")
    speaker_of = _speaker_rule(speaker, root)
    found = _files_by_key(root, transcripts)
    _join_lone_stems(found)
    stems = Counter(stem for (_, stem), kinds in found.items() if _is_take(kinds))
    takes, ids = [], Counter[str]()
    audio_names = sorted({path.name for kinds in found.values() for path in kinds.get("audio", ())})
    if missing_audio == "auto":
        missing_audio = "skip" if audio_names else "silence"
        if not audio_names:
            _log.warning("no audio file below %s: motion is read with silence in its place", root)
    for (folders, stem), kinds in sorted(found.items()):
        if not _is_take(kinds):
            continue
        path = (kinds.get("motion") or kinds["audio"])[0]
        name = path.stem if stems[stem] == 1 else "-".join((*folders, path.stem))
        name = re.sub(r"[^\w.-]|[^\x00-\x7f]", "_", name)
        ids[name.lower()] += 1
        if ids[name.lower()] > 1:
            name = f"{name}-{ids[name.lower()]}"
        who = speaker_of(path)
        no_audio = _no_audio(path, audio_names) if "audio" not in kinds else ""
        problem = no_audio if no_audio and missing_audio == "skip" else None
        if "motion" not in kinds:
            problem = f"no {path.stem}.bvh for {path.name}"
        if who is None:
            problem = f"the speaker pattern {speaker!r} does not occur in {path.relative_to(root)}"
        takes.append(
            Take(
                name,
                who or "",
                kinds.get("motion", [None])[0],
                tuple(kinds.get("audio", ())),
                tuple(kinds.get("transcript", ())),
                problem,
                phase_files=tuple(kinds.get("phases", ())),
                no_audio=no_audio,
            )
        )
    if not takes:
        raise CospeechError(
            f"no take below {root}: it has no .bvh and no {', '.join(DIRECT_SUFFIXES)} file",
            hint="point data.root at the folder of the BVH and audio files, or of their folders",
        )
    return sorted(takes, key=lambda take: take.id)


def files_named(root: str | Path, pattern: str) -> list[Path]:
    """Files below a folder whose whole name fits a regular expression, case aside; sorted.

    Raises:
        CospeechError: The folder is absent or holds more than `MAX_FILES` files.
    """
    regex = re.compile(pattern, re.IGNORECASE)
    return [path for path, _ in _walk(Path(root)) if regex.fullmatch(path.name)]


def _walk(root: Path) -> list[tuple[Path, tuple[str, ...]]]:
    """Files, none hidden, in a fixed order, each with its folders below the root.

    Links to folders elsewhere are followed, to each folder once; those to folders below the root
    lead to nothing new.
    """
    existing_folder(root)
    found: list[tuple[Path, tuple[str, ...]]] = []
    real_root, seen = root.resolve(), set[Path]()

    def leads_on(path: Path) -> bool:
        if not path.is_symlink():
            return True
        real = Path(os.path.realpath(path))
        if real_root.is_relative_to(real):
            _log.warning("%s leads back to %s and is not followed", path, real)
            return False
        return not real.is_relative_to(real_root)

    def unreadable(error: OSError) -> None:
        _log.warning("%s can't be looked into (%s)", error.filename, error.strerror)

    for folder, folders, names in os.walk(root, onerror=unreadable, followlinks=True):
        real = Path(os.path.realpath(folder))
        if real in seen:
            folders[:] = []
            continue
        seen.add(real)
        named = (name for name in sorted(folders) if not name.startswith("."))
        folders[:] = [name for name in named if leads_on(Path(folder, name))]
        parts = Path(folder).relative_to(root).parts
        found += [(Path(folder, name), parts) for name in sorted(names) if not name.startswith(".")]
        if len(found) > MAX_FILES:
            raise CospeechError(
                f"more than {MAX_FILES} files below {root}", hint="point data.root at one corpus"
            )
    return found


def _files_by_key(root: Path, transcripts: Sequence[str]) -> dict[_Key, _Kinds]:
    """Paths by kind, the preferred first, for each stem in each folder that is a speaker's."""
    kinds_of = {".bvh": "motion"} | dict.fromkeys(AUDIO_SUFFIXES, "audio")
    kinds_of |= dict.fromkeys(transcripts, "transcript") | dict.fromkeys(PHASE_SUFFIXES, "phases")
    preference = {suffix: i for i, suffix in enumerate(kinds_of)}
    found: dict[_Key, _Kinds] = defaultdict(dict)
    for path, parts in _walk(root):
        suffix = _suffix(path)
        if suffix not in kinds_of:
            continue
        where = tuple(part.lower() for part in parts if not _ROLE.fullmatch(part))
        stem = path.name[: -len(suffix)].lower()
        paths = found[where, stem].setdefault(kinds_of[suffix], [])
        paths.append(path)
        paths.sort(key=lambda path: preference[_suffix(path)])
    return found


def _suffix(path: Path) -> str:
    name = path.name.lower()
    several = (*PHASE_SUFFIXES, *PACKED_SUFFIXES)
    return next((suffix for suffix in several if name.endswith(suffix)), path.suffix.lower())


def _join_lone_stems(found: dict[_Key, _Kinds]) -> None:
    """Bring together files of one stem that lie in unrelated folders, where that is unambiguous."""
    by_stem: dict[str, list[_Key]] = defaultdict(list)
    for key in found:
        by_stem[key[1]].append(key)
    for keys in by_stem.values():
        for kind in ("audio", "transcript", "phases"):
            having = [key for key in keys if kind in found[key]]
            wanting = [key for key in keys if "motion" in found[key] and kind not in found[key]]
            if len(having) == len(wanting) == 1:
                found[wanting[0]][kind] = found[having[0]].pop(kind)


def _is_take(kinds: _Kinds) -> bool:
    """Whether there is motion, or a sound file that wants one; a video alone is a picture of it."""
    if "motion" in kinds:
        return True
    return any(path.suffix.lower() not in VIDEO_SUFFIXES for path in kinds.get("audio", ()))


def _no_audio(motion: Path, audio_names: list[str]) -> str:
    there = ", ".join(audio_names[:3]) + (" ..." if len(audio_names) > 3 else "")
    suffixes = "/".join(DIRECT_SUFFIXES)
    return f"no {motion.stem}{suffixes} for {motion.name}; audio found: {there or 'none'}"


def _speaker_rule(rule: str, root: Path) -> Callable[[Path], str | None]:
    def by_folder(path: Path) -> str:
        parts = path.relative_to(root).parts[:-1]
        return next((p for p in reversed(parts) if not _ROLE.fullmatch(p)), root.resolve().name)

    if rule == "folder":
        return by_folder
    if rule == "prefix":
        return lambda path: re.split(r"[_-]", path.stem, maxsplit=1)[0]
    try:
        pattern = linear_pattern(rule)
    except CospeechError as error:
        raise ConfigError(f"data.speaker: {error.problem}", error.hint) from error
    if not pattern.groups:
        raise CospeechError(
            f"data.speaker={rule!r} is neither 'folder' nor 'prefix' nor a pattern with a group",
            hint=r"for names such as 2_scott_0_1_1.bvh give '^\d+_([a-z]+)_'",
        )
    group: str | int = "speaker" if "speaker" in pattern.groupindex else 1

    def by_pattern(path: Path) -> str | None:
        match = pattern.search(path.relative_to(root).as_posix())
        return match[group] if match else None

    return by_pattern
