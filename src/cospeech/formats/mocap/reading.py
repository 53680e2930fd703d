"""Reading takes: motion, audio and words on one clock."""

from __future__ import annotations

import functools
import logging
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording, Remark
from cospeech.corpus.source import Dropped, Source
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.mocap.side_files import (
    LOOK_CLOSER,
    first_usable,
    spoken,
    words_until,
)
from cospeech.formats.mocap.takes import AS_FILES_SAY, ReadingSettings, Take, Voice
from cospeech.formats.phase_files import read_phases
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton
from cospeech.motion.bvh_rate import PLAUSIBLE_FPS
from cospeech.motion.joint_map import JointMap, find_joint_map
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PhaseSegment, frame_phases
from cospeech.motion.upper_body import doubts_about, to_upper_body
from cospeech.speech.audio import read_audio
from cospeech.speech.speech import SAMPLE_RATE, Speech

TOLERATED_S = 1.0
TOLERATED_SHARE = 0.2
ENOUGH_POSES = 300
"""Frames, evenly spread, that show a body's average pose."""

_log = logging.getLogger(__name__)


def take_sources(takes: Iterable[Take], settings: ReadingSettings = AS_FILES_SAY) -> list[Source]:
    """A source per take, in the order of the takes.

    Args:
        takes: Of `find_takes` or of a corpus's own finder.
        settings: How all of them are read.
    """
    return [
        Source(take.id, functools.partial(_read_source, take, settings), take.files)
        for take in takes
    ]


def _read_source(take: Take, settings: ReadingSettings) -> list[Recording | Dropped]:
    if take.left_out is not None:
        return [Dropped(take.id, take.problem or take.left_out, take.left_out)]
    return [read_take(take, settings)]


def read_take(take: Take, settings: ReadingSettings = AS_FILES_SAY) -> Recording:
    """Read a take's audio, motion and words, and bring them to one clock and one length.

    Motion and audio start where the take's excerpt says; the longer is cut to the shorter. A
    difference over one second and whatever looks wrong about the body (`doubts_about`) is noted in
    ``remarks`` (and ``annotations["warnings"]``) and logged; what the take's finder warned of
    (`Take.warnings`) is noted with it. A transcript, an annotation or the other speaker that can't
    be used costs itself, with a remark, never the take. Without an audio file the speech is silence
    as long as the motion, and ``annotations["silent"]`` is true.

    Args:
        take: From `find_takes` or a corpus's own finder.
        settings: How it is read.

    Returns:
        Full-skeleton motion at its own rate; the skeleton carries the joint map and its name.

    Raises:
        CospeechError: The take has a ``problem``.
        InputFileError: Motion or audio is broken, the skeleton has no joint map, an excerpt starts
            after the end of its file, or audio and motion differ by more than a fifth of the
            longer.
    """
    if take.motion is None or take.problem is not None:
        hint = None
        if take.motion is not None and take.audio is None and take.left_out is None:
            hint = (
                "data.missing_audio=silence reads motion without audio, with silence in its place"
            )
        raise CospeechError(f"take {take.id} can't be read: {take.problem or 'no motion'}", hint)
    remarks, files = list(take.warnings), [take.motion]
    motion, first_frame, whole_frames, joint_map = _motion(take, take.motion, settings, remarks)
    if take.published_rate is not None and abs(motion.fps - take.published_rate) > 0.01:
        text = (
            f"{take.motion.name} is at {motion.fps:g} fps, the corpus was published at"
            f" {take.published_rate:g}: a derived copy?"
        )
        advice = f"data.frame_rate={take.published_rate:g} where the headers are wrong"
        remarks.append(Remark("not at the published rate", text, advice))
    annotations: dict[str, Any] = dict(take.annotations) | {"joint_map": joint_map.name}
    if take.audio is None:
        waveform = np.zeros(round(motion.duration * SAMPLE_RATE), np.float32)
        annotations["silent"] = True
        text = (
            f"{take.no_audio or f'no audio for {take.motion.name}'}: silence as long as the motion"
        )
        remarks.append(Remark("silence in the place of sound", text, "data.missing_audio=skip"))
    else:
        read_sound = functools.partial(_audio, take, remarks=remarks)
        sound = first_usable(take.sounds, "sound", read_sound, remarks, is_needed=True)
        assert sound is not None
        path, waveform = sound
        files.append(path)
    audio_s = len(waveform) / SAMPLE_RATE
    remarks += _length_remarks(take.motion, motion, audio_s)
    words = None
    transcript = spoken(take, take.transcripts, "a transcript", audio_s, remarks)
    if transcript is not None:
        files.append(transcript[0])
        words, annotations["word_timing"] = transcript[1].words, transcript[1].timing
    shared_s = min(audio_s, motion.duration)
    motion = motion.slice(0, max(1, round(shared_s * motion.fps)))
    poses = motion.slice(0, len(motion), max(1, len(motion) // ENOUGH_POSES))
    doubts = doubts_about(to_upper_body(poses, joint_map))
    remarks += [Remark("a body that looks wrong", text, LOOK_CLOSER) for text in doubts]
    read_segments = functools.partial(
        _phases, settings=settings, motion_s=whole_frames / motion.fps
    )
    segments = first_usable(take.phase_files, "gesture phases", read_segments, remarks)
    phases = None
    if segments is not None:
        files.append(segments[0])
        labels = frame_phases(segments[1], whole_frames, motion.fps)
        phases = labels[first_frame : first_frame + len(motion)]
    interlocutor = None
    if (voice := take.interlocutor) is not None:
        listen = functools.partial(_interlocutor, take, voice, shared_s=shared_s, remarks=remarks)
        heard = first_usable((voice.audio,), "the other speaker's sound", listen, remarks)
        interlocutor = None if heard is None else heard[1]
    for remark in remarks[len(take.warnings) :]:
        _log.warning("take %s: %s", take.id, remark.text)
    if remarks:
        annotations["warnings"] = [remark.text for remark in remarks]
    return Recording(
        id=take.id,
        speaker=take.speaker,
        speech=Speech(waveform[: round(shared_s * SAMPLE_RATE)], words_until(words, shared_s)),
        motion=motion,
        phases=phases,
        annotations=annotations,
        split=take.split,
        source=" + ".join(path.name for path in files),
        files=tuple(files),
        licence=take.licence or settings.licence,
        interlocutor=interlocutor,
        remarks=tuple(remarks),
    )


def _phases(path: Path, *, settings: ReadingSettings, motion_s: float) -> list[PhaseSegment]:
    """Gesture phases on the clock of a motion file that lasts so long."""
    segments = read_phases(path, settings.phase_tier, settings.phase_labels)
    end_s = max((segment.end_s for segment in segments), default=0.0)
    if end_s - motion_s > max(TOLERATED_S, TOLERATED_SHARE * end_s):
        is_milliseconds = 0.5 * motion_s < end_s / 1000 < motion_s + TOLERATED_S
        raise InputFileError(
            path,
            f"its last phase ends at {end_s:.2f} s, but the motion lasts {motion_s:.2f} s"
            + (": the times look like milliseconds" if is_milliseconds else ""),
            hint="divide them by 1000" if is_milliseconds else "is it of another take?",
        )
    return segments


def _motion(
    take: Take, path: Path, settings: ReadingSettings, remarks: list[Remark]
) -> tuple[Motion, int, int, JointMap]:
    """The excerpt's motion, its first frame in the file, the file's frames, and the joint map."""
    joint_map, unit_scale = settings.joint_map, settings.unit_scale
    if joint_map is None:
        try:
            joint_map = find_joint_map(read_bvh_skeleton(path))
        except InputFileError:
            raise
        except CospeechError as error:
            raise InputFileError(path, error.problem, hint=error.hint) from error
    warned: list[str] = []
    whole = read_bvh(
        path,
        frame_rate=settings.frame_rate,
        unit_scale=joint_map.unit_scale if unit_scale is None else unit_scale,
        up_axis=settings.up_axis,
        warn=warned.append,
    )
    remarks += [Remark("odd motion file", text, "export it again", path) for text in warned]
    start, duration = take.excerpt.motion_start, take.excerpt.duration
    first = round(start * whole.fps)
    stop = len(whole) if duration is None else round((start + duration) * whole.fps)
    if not 0 <= first < min(stop, len(whole)):
        raise _beyond_the_end(take, path, start, whole.duration)
    motion = whole.slice(first, stop) if (first, stop) != (0, len(whole)) else whole
    skeleton = replace(motion.skeleton, name=joint_map.name, joint_map=joint_map)
    return replace(motion, skeleton=skeleton), first, len(whole), joint_map


def _audio(take: Take, path: Path, remarks: list[Remark]) -> NDArray[np.float32]:
    """The excerpt's waveform."""
    whole, oddities = read_audio(path)
    remarks += [
        Remark("odd audio file", f"{path.name} {oddity}", "export it again from the original", path)
        for oddity in oddities
    ]
    start, duration = take.excerpt.audio_start, take.excerpt.duration
    first = round(start * SAMPLE_RATE)
    if not 0 <= first < len(whole):
        raise _beyond_the_end(take, path, start, len(whole) / SAMPLE_RATE)
    if first == 0 and duration is None:
        return whole
    stop = None if duration is None else first + round(duration * SAMPLE_RATE)
    return whole[first:stop].copy()


def _beyond_the_end(take: Take, path: Path, start_s: float, length_s: float) -> InputFileError:
    tables = ", ".join(table.name for table in take.tables)
    return InputFileError(
        path,
        f"recording {take.id} starts at {start_s:.2f} s of this file, which lasts {length_s:.2f} s",
        hint=f"check the offset table ({tables})" if tables else "is it another cut of the take?",
    )


def _interlocutor(
    take: Take, voice: Voice, audio: Path, *, shared_s: float, remarks: list[Remark]
) -> Speech:
    """The other speaker, cut or filled with silence to the take's length."""
    waveform = _audio(take, audio, remarks)
    samples = round(shared_s * SAMPLE_RATE)
    if abs(len(waveform) / SAMPLE_RATE - shared_s) > TOLERATED_S:
        text = (
            f"the other speaker's {audio.name} lasts {len(waveform) / SAMPLE_RATE:.2f} s,"
            f" the take {shared_s:.2f} s; it was cut or filled with silence"
        )
        remarks.append(Remark("another length of the other speaker", text, LOOK_CLOSER))
    what = "the other speaker's transcript"
    transcript = spoken(
        take, voice.transcripts, what, max(len(waveform) / SAMPLE_RATE, shared_s), remarks
    )
    words = None if transcript is None else transcript[1].words
    waveform = np.pad(waveform[:samples], (0, max(0, samples - len(waveform))))
    return Speech(waveform, words_until(words, shared_s))


def _length_remarks(path: Path, motion: Motion, audio_s: float) -> list[Remark]:
    difference = abs(motion.duration - audio_s)
    lengths = f"the motion lasts {motion.duration:.2f} s, the audio {audio_s:.2f} s"
    if difference > TOLERATED_SHARE * max(motion.duration, audio_s):
        hint = "check that both are of one take, and complete"
        rate = len(motion) / audio_s if audio_s else 0.0
        if PLAUSIBLE_FPS[0] <= rate <= PLAUSIBLE_FPS[1]:
            hint = (
                f"if they are, the {len(motion)} frames are at about {rate:.4g} fps and not"
                f" {motion.fps:g}: set data.frame_rate"
            )
        raise InputFileError(path, f"{lengths}: they can't be the same take", hint=hint)
    if difference <= TOLERATED_S:
        return []
    return [
        Remark("audio and motion of unequal length", f"{lengths}; the longer was cut", LOOK_CLOSER)
    ]
