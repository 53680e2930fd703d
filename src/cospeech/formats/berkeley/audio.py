"""Where the audio of an interval is, and cutting it.

Three layouts are known, in order of preference:

* ``<speaker>/train/audio/<interval>-<start>-<end>.wav``: what the published extraction writes;
* ``<speaker>/audio/<video>.wav`` (flac, ogg, mp3), a whole video's sound;
* ``<speaker>/videos/<video>.wav`` (flac, ogg, mp3), the same beside the video.

``<video>`` is the video's name with or without its container's suffix.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import require_no_pipe
from cospeech.formats.berkeley.layout import parse_time, video_stem
from cospeech.speech.audio_streams import libsndfile_name
from cospeech.speech.speech import SAMPLE_RATE

SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")

_CLOCK = r"\d\d?[:_]\d\d[:_]\d\d(?:[.,]\d{1,9})?"
_INTERVAL_FILE = re.compile(rf"(.+)-({_CLOCK})-({_CLOCK})\.(?:wav|flac|ogg|mp3)", re.IGNORECASE)
_MARGIN_S = 0.05
_BLOCK_VALUES = 2**20
_LOUDEST = 8.0


@dataclass(frozen=True)
class AudioFile:
    """A sound file and the time in the video at which it starts, seconds."""

    path: Path
    start: float


def find_audio(root: Path, speaker: str, interval: str, video: str) -> AudioFile | None:
    """The file that has an interval's audio; None when there is none."""
    intervals = _interval_files(root / speaker / "train" / "audio")
    if interval in intervals:
        return intervals[interval]
    for folder in ("audio", "videos"):
        for name in dict.fromkeys((video_stem(video), video)):
            for suffix in SUFFIXES:
                path = root / speaker / folder / f"{name}{suffix}"
                if name and "/" not in name and path.is_file():
                    return AudioFile(path, 0.0)
    return None


@functools.lru_cache(maxsize=16)
def _interval_files(folder: Path) -> dict[str, AudioFile]:
    if not folder.is_dir():
        return {}
    found = {}
    for path in sorted(folder.iterdir(), reverse=True):
        if match := _INTERVAL_FILE.fullmatch(path.name):
            found[match[1]] = AudioFile(path, parse_time(match[2]))
    return found


def read_audio(audio: AudioFile, start: float, duration: float) -> tuple[NDArray[np.float32], int]:
    """A piece of a sound file, mono at 16 kHz; only the piece is read.

    Args:
        audio: The file.
        start: Seconds in the video.
        duration: Seconds.

    Returns:
        ``(round(duration * 16000),)`` samples in [-1, 1], zero where the file has none, as the
        published code pads; and how many the file had.

    Raises:
        InputFileError: The file is damaged, or holds NaN or unscaled integers.
    """
    wanted = round(duration * SAMPLE_RATE)
    waveform = np.zeros(wanted, dtype=np.float32)
    # The resampler needs some sound on both sides, or the piece's edges would ring.
    begin = max(0.0, start - audio.start - _MARGIN_S)
    require_no_pipe(audio.path)
    try:
        with soundfile.SoundFile(libsndfile_name(audio.path)) as file:
            rate = file.samplerate
            first = min(round(begin * rate), file.frames)
            file.seek(first)
            last = round((start - audio.start + duration + _MARGIN_S) * rate)
            mono = _resampled(file, max(0, last - first))
    except (soundfile.SoundFileError, RuntimeError, OSError, TypeError) as error:
        reason = getattr(error, "error_string", error)
        raise InputFileError(audio.path, f"can't be read as audio ({reason})") from error
    if not np.isfinite(mono).all() or np.abs(mono).max(initial=0.0) > _LOUDEST:
        raise InputFileError(
            audio.path, "holds NaN, or floats beyond 8", f"at {start - audio.start:.1f} s"
        )
    skipped = round((start - audio.start - first / rate) * SAMPLE_RATE)
    into = max(0, -skipped)
    piece = mono[max(0, skipped) :][: max(0, wanted - into)]
    waveform[into : into + len(piece)] = piece
    return np.clip(waveform, -1.0, 1.0, out=waveform), len(piece)


def _resampled(file: soundfile.SoundFile, frames: int) -> NDArray[np.float32]:
    """Mono 16 kHz of the next frames, block by block: memory follows the result."""
    if not 1_000 <= file.samplerate <= 768_000:
        raise RuntimeError(f"a sample rate of {file.samplerate} Hz")
    stream = soxr.ResampleStream(file.samplerate, SAMPLE_RATE, 1, dtype="float32")
    block = max(1, _BLOCK_VALUES // file.channels)
    average = np.full(file.channels, 1 / file.channels, dtype=np.float32)
    parts: list[NDArray[np.float32]] = []
    is_last = False
    while not is_last:
        values = file.read(min(block, frames), dtype="float32", always_2d=True)
        frames -= len(values)
        is_last = frames == 0 or len(values) < min(block, frames + len(values))
        parts.append(stream.resample_chunk(values @ average, last=is_last))
    return np.concatenate(parts)
