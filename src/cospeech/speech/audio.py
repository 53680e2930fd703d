"""Audio files: any rate and channel count in, mono float32 at 16 kHz inside the framework."""

from __future__ import annotations

import logging
import os
import shlex
from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.speech.speech import SAMPLE_RATE

MAX_DURATION_S = 4 * 3600.0
"""Longest recording that is loaded: four hours are 0.9 GB of float32 at 16 kHz."""

READABLE = "wav, flac, ogg or mp3"

_log = logging.getLogger(__name__)

_RATES_HZ = range(1_000, 768_001)
_BLOCK_VALUES = 1 << 20  # frames times channels per read: a hostile header can't make us allocate
_INTEGER_LIKE_PEAK = (
    8.0  # float files overshoot 1 a little; beyond this they hold unscaled integers
)
_CONTAINER_SUFFIXES = {
    ".m4a",
    ".mp4",
    ".m4v",
    ".mov",
    ".aac",
    ".wma",
    ".webm",
    ".mkv",
    ".avi",
    ".3gp",
}


def load_audio(path: str | Path, max_duration_s: float = MAX_DURATION_S) -> NDArray[np.float32]:
    """Read a recording as mono float32 at 16 kHz.

    Channels are averaged, other rates are resampled (soxr, high quality), and what then lies
    outside [-1, 1] is clipped. The file is read block by block, so memory follows its real
    length, not what its header claims.

    Args:
        path: A wav, flac, ogg or mp3 file.
        max_duration_s: Refuse anything longer, in seconds.

    Returns:
        ``(N,)`` samples in [-1, 1], ``N = round(seconds * 16000)``.

    Raises:
        InputFileError: The file is missing, empty, in another format, damaged or too long, or
            it holds NaN or unscaled integers.
    """
    path = Path(path)
    _check_is_file(path)
    try:
        file = soundfile.SoundFile(path)
    except (soundfile.SoundFileError, TypeError) as error:
        raise _unknown_format(path, error) from error
    with file:
        waveform = _read_blocks(path, file, max_duration_s)
    if waveform.size == 0:
        raise InputFileError(path, "has no audio samples", hint="record or export it again")
    return np.clip(waveform, -1.0, 1.0, out=waveform)


def save_wav(path: str | Path, waveform: NDArray[np.floating]) -> None:
    """Write a waveform as a mono 16 kHz PCM16 wav file; an existing file is replaced atomically.

    A sample becomes ``round(32768 * x)``, clipped to the 16-bit range, so reading it back is at
    most half a step (1.5e-5) away; only values above 32767/32768 lose more.

    Args:
        path: The file to write; its folder must exist.
        waveform: ``(N,)`` samples in [-1, 1] at 16 kHz.

    Raises:
        ValueError: The waveform is not one-dimensional or not finite.
    """
    if waveform.ndim != 1:
        raise ValueError(f"a waveform is (samples,), got shape {waveform.shape}")
    if not np.isfinite(waveform).all():
        raise ValueError("the waveform holds NaN or infinity")
    steps = np.clip(np.rint(waveform * 32768.0), -32768, 32767).astype(np.int16)
    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        soundfile.write(partial, steps, SAMPLE_RATE, subtype="PCM_16", format="WAV")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _check_is_file(path: Path) -> None:
    if not path.exists():
        raise InputFileError(path, "no such audio file", hint="check the path")
    if not path.is_file():
        raise InputFileError(path, "is not a file", hint=f"give one {READABLE} file")
    if path.stat().st_size == 0:
        raise InputFileError(path, "the file is empty (0 bytes)", hint="copy or export it again")


def _unknown_format(path: Path, error: Exception) -> InputFileError:
    with path.open("rb") as file:
        head = file.read(12)
    is_container = (
        head[4:8] == b"ftyp"  # MP4 family
        or head[:4] == b"\x1a\x45\xdf\xa3"  # Matroska and WebM
        or path.suffix.lower() in _CONTAINER_SUFFIXES
    )
    reason = (
        f"this container ({path.suffix or 'MP4 or Matroska'}) is not read directly"
        if is_container
        else f"can't be read as audio ({str(error).rstrip('.')})"
    )
    source, target = shlex.quote(str(path)), shlex.quote(str(path.with_suffix(".wav")))
    command = f"ffmpeg -i {source} -ac 1 -ar {SAMPLE_RATE} {target}"
    return InputFileError(path, reason, hint=f"convert it to {READABLE}, e.g. {command}")


def _read_blocks(
    path: Path, file: soundfile.SoundFile, max_duration_s: float
) -> NDArray[np.float32]:
    rate = file.samplerate
    if rate not in _RATES_HZ:
        raise InputFileError(
            path,
            f"claims a sample rate of {rate} Hz",
            hint=f"expected {_RATES_HZ.start} to {_RATES_HZ[-1]} Hz; export it again at 16000 Hz",
        )
    # SoXR's stream passes audio through untouched when the two rates are equal.
    resampler = soxr.ResampleStream(rate, SAMPLE_RATE, 1, dtype="float32")
    block_frames = max(1, _BLOCK_VALUES // file.channels)
    parts: list[NDArray[np.float32]] = []
    frames_read = 0
    while True:
        try:
            block = file.read(block_frames, dtype="float32", always_2d=True)
        except soundfile.SoundFileError as error:
            raise InputFileError(
                path,
                f"is damaged ({error})",
                place=f"at {frames_read / rate:.1f} s",
                hint="copy or download it again",
            ) from error
        _check_values(path, block, frames_read / rate, rate)
        frames_read += len(block)
        if frames_read > max_duration_s * rate:
            raise InputFileError(
                path,
                f"is longer than {max_duration_s / 3600:g} h",
                hint="cut it into parts and load them one by one",
            )
        is_last = len(block) < block_frames
        parts.append(resampler.resample_chunk(block.mean(axis=1), last=is_last))
        if is_last:
            break
    if 0 < frames_read < file.frames:
        _log.warning(
            "%s ends after %.1f s although its header promises %.1f s",
            path,
            frames_read / rate,
            file.frames / rate,
        )
    return np.concatenate(parts)


def _check_values(path: Path, block: NDArray[np.float32], start_s: float, rate: int) -> None:
    is_finite = np.isfinite(block).all(axis=1)
    if not is_finite.all():
        raise InputFileError(
            path,
            "holds NaN or infinite samples",
            place=f"at {start_s + np.argmin(is_finite) / rate:.3f} s",
            hint="export the recording again; no player can play these samples either",
        )
    peak = float(np.abs(block).max(initial=0.0))
    if peak > _INTEGER_LIKE_PEAK:
        raise InputFileError(
            path,
            f"float samples reach {peak:.6g}, but full scale is 1",
            place=f"near {start_s:.1f} s",
            hint="integers were saved as floats: divide by 32768 (16 bit) or normalise, save again",
        )
