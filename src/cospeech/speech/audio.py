"""Audio files: any rate and channel count in, mono float32 at 16 kHz inside the framework."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from cospeech.errors import ContentError
from cospeech.foreign import understood
from cospeech.speech.audio_streams import (
    READABLE,
    UNKNOWN_FRAMES,
    libsndfile_name,
    open_sound,
)
from cospeech.speech.speech import SAMPLE_RATE

MAX_DURATION_S = 4 * 3600.0
"""Longest recording that is loaded: four hours are 0.9 GB of float32 at 16 kHz."""

SHORT_S, LEAST_BYTES_PER_S = 1800.0, 16.0
"""What lasts longer than the first, s, has at least so many bytes a second: the sparest speech
coders write fifty times as many, and a second of digital silence in a usual flac file has forty."""

CANCELLED = 0.02
"""Power of the mix, as a share of what channels that have nothing to do with each other would add
up to, below which they cancel each other out; opposite channels of slightly different gain."""

AUDIBLE_POWER = 1e-6
"""A channel above it (-60 dB of full scale) holds sound."""

_log = logging.getLogger(__name__)

_RATES_HZ = range(1_000, 768_001)
_GROWTH = 1 << 24  # samples
_INTEGER_LIKE_PEAK = (
    8.0  # float files overshoot 1 a little; beyond this they hold unscaled integers
)


def load_audio(path: str | Path, max_duration_s: float = MAX_DURATION_S) -> NDArray[np.float32]:
    """Read a recording as mono float32 at 16 kHz; what is odd about it is logged.

    See `read_audio`.

    Args:
        path: A sound file.
        max_duration_s: Refuse anything longer, in seconds.

    Raises:
        InputFileError: As `read_audio`.
    """
    waveform, oddities = read_audio(path, max_duration_s)
    for oddity in oddities:
        _log.warning("%s %s", path, oddity)
    return waveform


def read_audio(
    path: str | Path, max_duration_s: float = MAX_DURATION_S
) -> tuple[NDArray[np.float32], list[str]]:
    """Read a recording as mono float32 at 16 kHz, and say what is odd about it.

    Channels are averaged, or, where their average cancels out, the loudest is taken. Other rates
    are resampled (soxr, high quality), and what then lies outside [-1, 1] is clipped. The file is
    read block by block to its end, so memory follows its real length, not what its header claims.

    Args:
        path: A wav, flac, ogg or mp3 file, or one in a container (m4a, mp4, ...) that an installed
            ffmpeg decodes: that of the extra ``video``, else the one on the path.
        max_duration_s: Refuse anything longer, in seconds.

    Returns:
        ``(N,)`` samples in [-1, 1], ``N = round(seconds * 16000)``; and a sentence per oddity,
        whose subject is the file.

    Raises:
        InputFileError: The file is missing, unreadable, empty, in another format, damaged or too
            long, for its size too, or it holds NaN or unscaled integers.
    """
    path = Path(path)
    with understood(path, "audio", hint="check the file, or convert it to wav"):
        _check_is_file(path)
        longest_s = min(max_duration_s, max(SHORT_S, path.stat().st_size / LEAST_BYTES_PER_S))
        waveform, power, oddities = _read(path, longest_s, max_duration_s, None)
        loudest = int(power[:-1].argmax())
        channels = len(power) - 1
        expected = power[:-1].sum() / channels**2
        if channels > 1 and power[loudest] > AUDIBLE_POWER and power[-1] < CANCELLED * expected:
            waveform, _, _ = _read(path, longest_s, max_duration_s, loudest)
            oddities.append(
                f"has channels that cancel each other out (one is inverted?): channel {loudest + 1}"
                f" of {channels} is used alone"
            )
        if waveform.size == 0:
            raise ContentError("has no audio samples", hint="record or export it again")
    return np.clip(waveform, -1.0, 1.0, out=waveform), oddities


def audio_seconds(path: str | Path) -> float:
    """Length of a sound file in seconds: by its header, else by reading all of it.

    Raises:
        InputFileError: As `read_audio`.
    """
    with understood(path, "audio", hint="check the file, or convert it to wav"):
        _check_is_file(Path(path))  # a pipe would never end
    try:
        header = soundfile.info(libsndfile_name(Path(path)))
        if 0 < header.frames < UNKNOWN_FRAMES and header.samplerate in _RATES_HZ:
            return float(header.frames / header.samplerate)
    except (soundfile.SoundFileError, OSError, TypeError):
        pass  # the reader knows better, or says what is wrong
    return len(read_audio(path)[0]) / SAMPLE_RATE


def _check_is_file(path: Path) -> None:
    if not path.exists():
        raise ContentError("no such audio file", hint="check the path")
    if not path.is_file():
        raise ContentError("is not a file", hint=f"give one {READABLE} file")
    if path.stat().st_size == 0:
        raise ContentError("the file is empty (0 bytes)", hint="copy or export it again")


def _read(
    path: Path, longest_s: float, max_duration_s: float, channel: int | None
) -> tuple[NDArray[np.float32], NDArray[np.float64], list[str]]:
    """One channel, or the mean of all; and the mean power of each and, last, of their mean."""
    waveform, filled, frames = np.empty(0, np.float32), 0, 0

    def append(samples: NDArray[np.float32]) -> None:
        nonlocal filled
        needed = filled + len(samples)
        if needed > len(waveform):
            # In place: parts and their concatenation would take the memory twice.
            grown = max(needed, min(2 * len(waveform), len(waveform) + _GROWTH))
            waveform.resize(grown, refcheck=False)
        waveform[filled:needed] = samples
        filled = needed

    with open_sound(path) as stream:
        rate, power = stream.rate, np.zeros(stream.channels + 1)
        if rate not in _RATES_HZ:
            raise ContentError(
                f"claims a sample rate of {rate} Hz",
                hint=f"expected {_RATES_HZ.start} to {_RATES_HZ[-1]} Hz; export it at 16000 Hz",
            )
        # SoXR's stream passes audio through untouched when the two rates are equal.
        resampler = soxr.ResampleStream(rate, SAMPLE_RATE, 1, dtype="float32")
        for block in stream.blocks:
            _check_values(block, frames / rate, rate)
            frames += len(block)
            if frames > longest_s * rate:
                raise _too_long(path, longest_s, max_duration_s)
            mix = block.mean(axis=1)
            power[:-1] += np.einsum("tc,tc->c", block, block, dtype=np.float64)
            power[-1] += np.einsum("t,t->", mix, mix, dtype=np.float64)
            append(resampler.resample_chunk(mix if channel is None else block[:, channel].copy()))
        append(resampler.resample_chunk(np.zeros(0, np.float32), last=True))
    waveform.resize(filled, refcheck=False)
    oddities = []
    if stream.promised is not None and 0 < frames < stream.promised:
        oddities.append(
            f"ends after {frames / rate:.1f} s although its header promises"
            f" {stream.promised / rate:.1f} s"
        )
    return waveform, power / max(1, frames), oddities


def _too_long(path: Path, longest_s: float, max_duration_s: float) -> ContentError:
    if longest_s < max_duration_s:
        return ContentError(
            f"claims over {longest_s:.0f} s of sound in {path.stat().st_size} bytes, as no"
            " recording does",
            hint="export it again from the original",
        )
    return ContentError(
        f"is longer than {max_duration_s / 3600:g} h",
        hint="cut it into parts and load them one by one",
    )


def _check_values(block: NDArray[np.float32], start_s: float, rate: int) -> None:
    is_finite = np.isfinite(block).all(axis=1)
    if not is_finite.all():
        raise ContentError(
            "holds NaN or infinite samples",
            place=f"at {start_s + np.argmin(is_finite) / rate:.3f} s",
            hint="export the recording again; no player can play these samples either",
        )
    peak = float(np.abs(block).max(initial=0.0))
    if peak > _INTEGER_LIKE_PEAK:
        raise ContentError(
            f"float samples reach {peak:.6g}, but full scale is 1",
            place=f"near {start_s:.1f} s",
            hint="integers were saved as floats: divide by 32768 (16 bit) or normalise, save again",
        )
