"""Folders of BVH motion with matching audio and, where there are any, transcripts.

Reads Trinity, GENEA 2020 to 2023, BEAT, ZeroEGGS and anybody's own recordings: files belong
together when their stems are equal, side by side or in folders such as ``Audio``, ``Motion`` and
``Transcripts``.
"""

from __future__ import annotations

import logging
import os
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from cospeech.corpus.recording import Recording
from cospeech.errors import CospeechError, InputFileError
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton
from cospeech.motion.joint_map import JointMap, find_joint_map
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import doubts_about, to_upper_body
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word
from cospeech.speech.transcript import read_transcript_with_timing

AUDIO_SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")
TRANSCRIPT_SUFFIXES = (".textgrid", ".json", ".tsv", ".ctm", ".srt", ".vtt", ".txt")
"""Both in order of preference, when a take has several."""
MAX_FILES = 200_000
TOLERATED_S = 1.0
TOLERATED_SHARE = 0.2

_KINDS = {".bvh": "motion"} | dict.fromkeys(AUDIO_SUFFIXES, "audio")
_KINDS |= dict.fromkeys(TRANSCRIPT_SUFFIXES, "transcript")
_ROLE = re.compile(
    r"audios?|wavs?|wave|speech|sound|motions?|bvhs?|mocap|transcripts?|texts?|txt|tsv|json|textgrids?",
    re.IGNORECASE,
)
_Key: TypeAlias = tuple[tuple[str, ...], str]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Take:
    """The files of one take, not yet opened.

    Attributes:
        id: Unique in the folder; letters, digits, ``-``, ``_``, ``.``.
        speaker: Speaker name.
        motion: The BVH file.
        audio: The sound file.
        transcript: The transcript; None when there is none.
        problem: Why the take can't be used; None when it can.
    """

    id: str
    speaker: str
    motion: Path | None
    audio: Path | None
    transcript: Path | None = None
    problem: str | None = None


def find_takes(root: str | Path, *, speaker: str = "folder") -> list[Take]:
    r"""The takes below a folder, by their paths alone: no file is opened.

    Args:
        root: The folder, searched with all its subfolders; hidden files and folders are left out.
        speaker: Where a take's speaker is named. ``"folder"``: the nearest folder above the file
            that isn't one of the ``Audio``/``Motion`` kind, at last ``root`` itself. ``"prefix"``:
            the file name up to its first ``_`` or ``-``. Else a regular expression with a group,
            searched in the path below ``root``: ``"^(\w+)/"``, ``"_(?P<speaker>[a-z]+)_"``.

    Returns:
        Takes sorted by id. One that lacks audio or motion is listed with its ``problem``.

    Raises:
        CospeechError: The folder is absent, holds no BVH or audio at all, or ``speaker`` is none of
            the three.
    """
    root = Path(root)
    speaker_of = _speaker_rule(speaker, root)
    found = _files_by_key(root)
    _join_lone_stems(found)
    stems = Counter(stem for (_, stem), kinds in found.items() if _is_take(kinds))
    takes, ids = [], Counter[str]()
    audio_names = sorted({kinds["audio"].name for kinds in found.values() if "audio" in kinds})
    for (folders, stem), kinds in sorted(found.items()):
        if not _is_take(kinds):
            continue
        path = kinds.get("motion") or kinds["audio"]
        name = path.stem if stems[stem] == 1 else "-".join((*folders, path.stem))
        name = re.sub(r"[^\w.-]|[^\x00-\x7f]", "_", name)
        ids[name.lower()] += 1
        if ids[name.lower()] > 1:
            name = f"{name}-{ids[name.lower()]}"
        who = speaker_of(path)
        problem = _missing(kinds, path.stem, audio_names)
        if who is None:
            problem = f"the speaker pattern {speaker!r} does not occur in {path.relative_to(root)}"
        takes.append(
            Take(
                name,
                who or "",
                kinds.get("motion"),
                kinds.get("audio"),
                kinds.get("transcript"),
                problem,
            )
        )
    if not takes:
        raise CospeechError(
            f"no take below {root}: it has no .bvh and no {', '.join(AUDIO_SUFFIXES)} file",
            hint="point data.root at the folder of the BVH and audio files, or of their folders",
        )
    return sorted(takes, key=lambda take: take.id)


def _files_by_key(root: Path) -> dict[_Key, dict[str, Path]]:
    """Paths by kind, for each stem in each folder that isn't one of the ``Audio`` kind."""
    if not root.is_dir():
        raise CospeechError(f"{root} is not a folder", hint="check the path (data.root)")
    best: dict[_Key, dict[str, Path]] = defaultdict(dict)
    preference = {s: i for i, s in enumerate((*AUDIO_SUFFIXES, *TRANSCRIPT_SUFFIXES))}
    seen = 0
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        parts = Path(folder).relative_to(root).parts
        where = tuple(part.lower() for part in parts if not _ROLE.fullmatch(part))
        for name in sorted(names):
            path = Path(folder, name)
            suffix = path.suffix.lower()
            if name.startswith(".") or suffix not in _KINDS:
                continue
            seen += 1
            if seen > MAX_FILES:
                raise CospeechError(
                    f"more than {MAX_FILES} motion, audio and text files below {root}",
                    hint="point data.root at one corpus",
                )
            kinds, kind = best[where, path.stem.lower()], _KINDS[suffix]
            old = kinds.get(kind)
            if old is None or preference.get(suffix, 0) < preference.get(old.suffix.lower(), 0):
                kinds[kind] = path
    return best


def _join_lone_stems(found: dict[_Key, dict[str, Path]]) -> None:
    """Bring together files of one stem that lie in unrelated folders, where that is unambiguous."""
    by_stem: dict[str, list[_Key]] = defaultdict(list)
    for key in found:
        by_stem[key[1]].append(key)
    for keys in by_stem.values():
        for kind in ("audio", "transcript"):
            having = [key for key in keys if kind in found[key]]
            wanting = [key for key in keys if "motion" in found[key] and kind not in found[key]]
            if len(having) == len(wanting) == 1:
                found[wanting[0]][kind] = found[having[0]].pop(kind)


def _is_take(kinds: dict[str, Path]) -> bool:
    return "motion" in kinds or "audio" in kinds


def _missing(kinds: dict[str, Path], stem: str, audio_names: list[str]) -> str | None:
    if "motion" not in kinds:
        return f"no {stem}.bvh for {kinds['audio'].name}"
    if "audio" not in kinds:
        there = ", ".join(audio_names[:3]) + (" ..." if len(audio_names) > 3 else "")
        suffixes = "/".join(AUDIO_SUFFIXES)
        return f"no {stem}{suffixes} for {kinds['motion'].name}; audio found: {there or 'none'}"
    return None


def _speaker_rule(rule: str, root: Path) -> Callable[[Path], str | None]:
    def by_folder(path: Path) -> str:
        parts = path.relative_to(root).parts[:-1]
        return next((p for p in reversed(parts) if not _ROLE.fullmatch(p)), root.resolve().name)

    if rule == "folder":
        return by_folder
    if rule == "prefix":
        return lambda path: re.split(r"[_-]", path.stem, maxsplit=1)[0]
    try:
        pattern = re.compile(rule)
    except re.error as error:
        raise CospeechError(f"speaker pattern {rule!r}: {error}") from error
    if not pattern.groups:
        raise CospeechError(
            f"speaker={rule!r} is neither 'folder' nor 'prefix' nor a pattern with a group",
            hint=r"for names such as 2_scott_0_1_1.bvh give '^\d+_([a-z]+)_'",
        )
    group: str | int = "speaker" if "speaker" in pattern.groupindex else 1

    def by_pattern(path: Path) -> str | None:
        match = pattern.search(path.relative_to(root).as_posix())
        return match[group] if match else None

    return by_pattern


def read_take(
    take: Take,
    *,
    frame_rate: float | None = None,
    unit_scale: float | None = None,
    joint_map: JointMap | None = None,
    licence: str = "",
) -> Recording:
    """Read a take's audio, motion and words, and bring them to one length.

    Audio and motion both start at 0; the longer is cut to the shorter. A difference over one second
    and whatever looks wrong about the body (`doubts_about`) is noted in
    ``annotations["warnings"]`` and logged.

    Args:
        take: From `find_takes`.
        frame_rate: Frames per second of the BVH rows, for files whose header is wrong.
        unit_scale: Metres per BVH unit; by the joint map when None.
        joint_map: Found by the skeleton's joints when None.
        licence: Licence of the data.

    Returns:
        Full-skeleton motion at its own rate; the skeleton is named after the joint map.

    Raises:
        CospeechError: The take has a ``problem``.
        InputFileError: A file is broken, the skeleton has no joint map, or audio and motion differ
            by more than a fifth of the longer.
    """
    if take.motion is None or take.audio is None or take.problem is not None:
        raise CospeechError(f"take {take.id} can't be read: {take.problem or 'a file is missing'}")
    if joint_map is None:
        try:
            joint_map = find_joint_map(read_bvh_skeleton(take.motion))
        except InputFileError:
            raise
        except CospeechError as error:
            raise InputFileError(take.motion, error.problem, hint=error.hint) from error
    motion = read_bvh(
        take.motion,
        frame_rate=frame_rate,
        unit_scale=joint_map.unit_scale if unit_scale is None else unit_scale,
    )
    motion = replace(motion, skeleton=replace(motion.skeleton, name=joint_map.name))
    waveform = load_audio(take.audio)
    audio_s = len(waveform) / SAMPLE_RATE
    warnings = _length_warnings(take, motion, audio_s)
    annotations: dict[str, Any] = {"joint_map": joint_map.name}
    words: tuple[Word, ...] | None = None
    if take.transcript is not None:
        transcript = read_transcript_with_timing(take.transcript, audio_s)
        words = transcript.words
        annotations["word_timing"] = transcript.timing
        if words[-1].end > audio_s + TOLERATED_S:
            warnings.append(
                f"{take.transcript.name} goes on to {words[-1].end:.1f} s, the audio ends at"
                f" {audio_s:.1f} s: is it the transcript of this take?"
            )
    shared_s = min(audio_s, motion.duration)
    motion = motion.slice(0, max(1, round(shared_s * motion.fps)))
    warnings += doubts_about(to_upper_body(motion, joint_map))
    for warning in warnings:
        _log.warning("take %s: %s", take.id, warning)
    if warnings:
        annotations["warnings"] = warnings
    sources = (path.name for path in (take.motion, take.audio, take.transcript) if path)
    return Recording(
        id=take.id,
        speaker=take.speaker,
        speech=Speech(waveform[: round(shared_s * SAMPLE_RATE)], _words_until(words, shared_s)),
        motion=motion,
        annotations=annotations,
        source=" + ".join(sources),
        licence=licence,
    )


def _length_warnings(take: Take, motion: Motion, audio_s: float) -> list[str]:
    assert take.motion is not None
    difference = abs(motion.duration - audio_s)
    lengths = f"the motion lasts {motion.duration:.2f} s, the audio {audio_s:.2f} s"
    if difference > TOLERATED_SHARE * max(motion.duration, audio_s):
        raise InputFileError(
            take.motion,
            f"{lengths}: they can't be the same take",
            hint=f"if they are, the {len(motion)} frames are at about"
            f" {len(motion) / audio_s:.4g} fps and not {motion.fps:g}: set data.frame_rate",
        )
    return [f"{lengths}; the longer was cut"] if difference > TOLERATED_S else []


def _words_until(words: Iterable[Word] | None, end_s: float) -> tuple[Word, ...] | None:
    if words is None:
        return None
    return tuple(replace(word, end=min(word.end, end_s)) for word in words if word.start < end_s)
