"""Fundamental frequency of speech by autocorrelation and a best path through the candidates.

The method of P. Boersma, "Accurate short-term analysis of the fundamental frequency and the
harmonics-to-noise ratio of a sampled sound", IFA Proceedings 17 (1993): the autocorrelation of a
windowed frame is divided by the window's own, its peaks are the candidates, and a shortest path
weighs their strength against jumps between frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from cospeech.speech.band_power import check_waveform
from cospeech.speech.speech import SAMPLE_RATE

_FRAMES_PER_BLOCK = 512  # bounds memory: about 20 MB at a time, however long the recording
_PERIODS_PER_FRAME = 3
_SMALLEST_ENERGY = 1e-30


@dataclass(frozen=True)
class PitchSpec:
    """What counts as a voice, and how readily the track may jump.

    Attributes:
        hop_samples: Samples from one frame's centre to the next; 160 are 10 ms.
        lowest_hz: Lowest frequency looked for; a frame holds three periods of it.
        highest_hz: Highest frequency looked for.
        candidates: Autocorrelation peaks kept per frame.
        silence: Frames whose peak is below this part of the recording's peak lean to unvoiced.
        voicing: Autocorrelation (0 to 1) above which a frame leans to voiced.
        octave_cost: Advantage of a candidate over one an octave below it.
        octave_jump_cost: Cost of a jump by one octave within 10 ms.
        voicing_change_cost: Cost of a change between voiced and unvoiced within 10 ms.
    """

    hop_samples: int = 160
    lowest_hz: float = 75.0
    highest_hz: float = 500.0
    candidates: int = 10
    silence: float = 0.03
    voicing: float = 0.45
    octave_cost: float = 0.01
    octave_jump_cost: float = 0.35
    voicing_change_cost: float = 0.14

    def __post_init__(self) -> None:
        if not 0 < self.lowest_hz < self.highest_hz <= SAMPLE_RATE / 4:
            raise ValueError(
                f"pitch is looked for between 0 and {SAMPLE_RATE // 4} Hz, "
                f"got {self.lowest_hz:g} to {self.highest_hz:g} Hz"
            )

    @property
    def frame_samples(self) -> int:
        """Samples per frame, even."""
        return 2 * round(_PERIODS_PER_FRAME * SAMPLE_RATE / self.lowest_hz / 2)

    @property
    def lags(self) -> range:
        """Periods looked at, in samples."""
        return range(
            math.floor(SAMPLE_RATE / self.highest_hz), math.ceil(SAMPLE_RATE / self.lowest_hz) + 1
        )


SPEECH_PITCH = PitchSpec()
"""Adult speech, 100 frames per second."""


def f0(waveform: NDArray[np.float32], spec: PitchSpec = SPEECH_PITCH) -> NDArray[np.float32]:
    """Fundamental frequency in Hz, NaN where the frame is unvoiced.

    Frame i is centred on sample ``i * hop_samples``, as in `features`. Whether a frame is loud
    enough to be voiced is judged against the loudest sample of the whole waveform given.

    Args:
        waveform: ``(N,)`` samples at 16 kHz.
        spec: Frames, range and costs.

    Returns:
        ``(1 + N // hop_samples,)`` float32 Hz; NaN, never 0, where unvoiced, so that a mean taken
        without care shows.

    Raises:
        ValueError: The waveform is not a non-empty ``(N,)`` array of floats.
    """
    waveform = check_waveform(waveform)
    frames = 1 + len(waveform) // spec.hop_samples
    signal = waveform - waveform.mean(dtype=np.float64).astype(np.float32)
    peak = float(np.abs(signal).max())
    if peak == 0.0:
        return np.full(frames, np.nan, dtype=np.float32)
    kept = min(spec.candidates, len(spec.lags))
    frequencies = np.empty((frames, kept + 1), dtype=np.float32)
    strengths = np.empty_like(frequencies)
    for rows, block in _frame_blocks(signal, frames, spec):
        frequencies[rows], strengths[rows] = _candidates(block, peak, kept, spec)
    path = _best_path(frequencies, strengths, spec)
    return frequencies[np.arange(frames), path]


def _frame_blocks(
    signal: NDArray[np.float32], frames: int, spec: PitchSpec
) -> Iterator[tuple[slice, NDArray[np.float32]]]:
    half = spec.frame_samples // 2
    padded = np.pad(signal, (half, half + spec.hop_samples))
    windows = np.lib.stride_tricks.sliding_window_view(padded, spec.frame_samples)
    windows = windows[:: spec.hop_samples][:frames]
    for start in range(0, frames, _FRAMES_PER_BLOCK):
        rows = slice(start, min(start + _FRAMES_PER_BLOCK, frames))
        yield rows, windows[rows]


def _candidates(
    frames: NDArray[np.float32], peak: float, count: int, spec: PitchSpec
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Frequencies (Hz) and strengths ``(frames, count + 1)``; column 0 is unvoiced (NaN)."""
    frames = frames - frames.mean(axis=1, keepdims=True)
    correlation = _normalised_autocorrelation(frames, spec)

    start, stop = spec.lags.start, spec.lags.stop
    before, centre, after = (correlation[:, start + i : stop + i] for i in (-1, 0, 1))
    is_peak = (centre > before) & (centre >= after) & (centre > 0.5 * spec.voicing)

    # A parabola through the three values gives the peak between the samples.
    slope, bend = 0.5 * (after - before), (centre - before) + (centre - after)
    shift = np.divide(slope, bend, out=np.zeros_like(slope), where=is_peak)
    height = np.minimum(centre + 0.5 * slope * shift, 1.0)
    lag = np.arange(start, stop, dtype=np.float32) + shift
    rank = height - spec.octave_cost * np.log2(lag * spec.highest_hz / SAMPLE_RATE)
    is_peak &= (lag * spec.highest_hz >= SAMPLE_RATE) & (lag * spec.lowest_hz <= SAMPLE_RATE)
    rank = np.where(is_peak, rank, -np.inf)

    kept = np.argpartition(-rank, count - 1, axis=1)[:, :count]
    strengths = np.take_along_axis(rank, kept, axis=1)
    frequencies = SAMPLE_RATE / np.take_along_axis(lag, kept, axis=1)

    middle = frames.shape[1] // (2 * _PERIODS_PER_FRAME)
    centre_part = frames[:, frames.shape[1] // 2 - middle : frames.shape[1] // 2 + middle]
    loudness = np.abs(centre_part).max(axis=1, keepdims=True) / peak
    unvoiced = spec.voicing + np.maximum(0.0, 2 - loudness * (1 + spec.voicing) / spec.silence)
    return (
        np.hstack([np.full_like(unvoiced, np.nan), frequencies]),
        np.hstack([unvoiced, strengths]),
    )


def _normalised_autocorrelation(
    frames: NDArray[np.float32], spec: PitchSpec
) -> NDArray[np.float32]:
    samples = spec.frame_samples
    window = np.hanning(samples + 2)[1:-1].astype(np.float32)
    lags = spec.lags.stop + 1  # one more than looked at, for the peaks' right neighbours
    size = fft.next_fast_len(samples + lags, real=True)
    raw = _autocorrelation(frames * window, size)[:, :lags]
    of_window = _autocorrelation(window[None], size)[:, :lags]
    energy = np.maximum(raw[:, :1], _SMALLEST_ENERGY)
    return raw / energy * (of_window[:, :1] / of_window)


def _autocorrelation(frames: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    spectrum = fft.rfft(frames, size, axis=1)
    return fft.irfft(spectrum.real**2 + spectrum.imag**2, size, axis=1)


def _best_path(
    frequencies: NDArray[np.float32], strengths: NDArray[np.float32], spec: PitchSpec
) -> NDArray[np.intp]:
    """Column of the chosen candidate in every frame: the path of greatest total strength."""
    frames, columns = frequencies.shape
    ten_ms = SAMPLE_RATE // 100
    jump_cost = spec.octave_jump_cost * ten_ms / spec.hop_samples
    change_cost = spec.voicing_change_cost * ten_ms / spec.hop_samples
    octaves = np.log2(frequencies)
    came_from = np.empty((frames, columns), dtype=np.int16)
    total = strengths[0]
    everywhere = np.arange(columns)
    for start in range(1, frames, _FRAMES_PER_BLOCK):
        stop = min(start + _FRAMES_PER_BLOCK, frames)
        # (frame, to, from); NaN marks a pair with an unvoiced member
        cost = jump_cost * np.abs(
            octaves[start:stop, :, None] - octaves[start - 1 : stop - 1, None]
        )
        cost[:, 0, :] = cost[:, :, 0] = change_cost
        cost[:, 0, 0] = 0.0
        for step, frame in enumerate(range(start, stop)):
            arriving = total - cost[step]
            best = arriving.argmax(axis=1)
            came_from[frame] = best
            total = arriving[everywhere, best] + strengths[frame]
    path = np.empty(frames, dtype=np.intp)
    path[-1] = total.argmax()
    for frame in range(frames - 1, 0, -1):
        path[frame - 1] = came_from[frame, path[frame]]
    return path
