"""Clipped, silent and broken audio."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.stretches import long_stretches, overlap_s, stretches
from cospeech.speech.speech import SAMPLE_RATE

LEVEL_HZ = 100
"""Values of the level curve per second; 10 ms is shorter than any phoneme."""

FLOOR_DB = -100.0
"""Level given to digital silence, dB below full scale."""

SILENT_DB = -60.0
"""A level below this is silence, dB below full scale: quiet speech peaks above -40, and 16-bit
recorders' own noise lies near -80."""

LONG_SILENCE_S = 10.0
"""Silence that a monologue rarely has; listeners in a dialogue do, so alone it is a warning."""

LONG_ZEROS_S = 1.0
"""Zeros, or one constant value, for so long come from editing or a lost connection, s."""

LOST_WORDS_S = 1.0
"""Seconds of transcribed words within a silence that make it lost speech; less is a word or two
that an aligner misplaced."""

FLAT_SAMPLES = 3
"""Samples in a row at the peak that make a flat top: a 16 kHz wave below 4 kHz that is not clipped
leaves its peak faster."""

FLAT_STEP = 2 / 32768
"""How exactly a flat top is flat: two steps of 16 bits."""

CLIPPED_SHARE, BADLY_CLIPPED_SHARE = 1e-4, 1e-3
"""Share of samples in flat tops. One shout in a minute stays below the first; at the second
there are some fifteen clipped samples in every second, and loudness is no longer measured."""

QUIET_PEAK = 0.05
"""Flat tops are looked for only where the peak is above this: noise of a few 16-bit steps has
many of them."""


def level_db(waveform: NDArray[np.float32]) -> NDArray[np.float64]:
    """Level of every 10 ms, dB below full scale.

    Args:
        waveform: ``(N,)`` at 16 kHz, without NaN.

    Returns:
        ``(N // 160,)``, at least `FLOOR_DB`.
    """
    hop = SAMPLE_RATE // LEVEL_HZ
    frames = waveform[: len(waveform) // hop * hop].reshape(-1, hop)
    power = np.einsum("ij,ij->i", frames, frames, dtype=np.float64) / hop
    return 10 * np.log10(power + 10 ** (FLOOR_DB / 10))


def check_signal(
    waveform: NDArray[np.float32], files: Files, is_dialogue: bool = False
) -> Iterator[Finding]:
    """NaN, nothing but silence, and flat tops.

    Args:
        waveform: ``(N,)`` at 16 kHz.
        files: What to call it.
        is_dialogue: Whether the recording is one side of a dialogue, who may well say nothing.
    """
    if len(waveform) == 0:
        return
    finite = np.isfinite(waveform)
    if not finite.all():
        yield Finding(
            Check.NOT_A_NUMBER,
            Severity.ERROR,
            files.audio,
            f"{np.count_nonzero(~finite)} samples are NaN or infinite",
            "export the recording again; no player can play these samples either",
            time_s=float(np.argmin(finite)) / SAMPLE_RATE,
        )
        return
    level = level_db(waveform)
    if len(level) and np.percentile(level, 99) < SILENT_DB:
        yield Finding(
            Check.SILENT,
            Severity.WARNING if is_dialogue else Severity.ERROR,
            files.audio,
            f"all of it is silent: 99 % stays below {SILENT_DB:g} dB of full scale",
            "check that it is the right track or channel (an unused microphone?), and export"
            " it again",
        )
        return
    yield from _clipped(waveform, files)


def _clipped(waveform: NDArray[np.float32], files: Files) -> Iterator[Finding]:
    first, count, level = len(waveform), 0, 0.0
    for peak, at_peak in (
        (waveform.max(), lambda peak: waveform >= peak - FLAT_STEP),
        (waveform.min(), lambda peak: waveform <= peak + FLAT_STEP),
    ):
        if abs(peak) < QUIET_PEAK:
            continue
        flat = long_stretches(at_peak(peak), FLAT_SAMPLES)
        if len(flat):
            first = min(first, int(flat[0, 0]))
            count += int((flat[:, 1] - flat[:, 0]).sum())
            level = max(level, float(abs(peak)))
    share = count / len(waveform)
    if share < CLIPPED_SHARE:
        return
    yield Finding(
        Check.CLIPPED,
        Severity.ERROR if share >= BADLY_CLIPPED_SHARE else Severity.WARNING,
        files.audio,
        f"{share:.2%} of the samples are cut off at {level:.2f} of full scale, first here",
        "export again from the original at a lower gain; if it was recorded so, leave the recording"
        " out or don't use features of loudness with it",
        time_s=first / SAMPLE_RATE,
    )


def check_silence(
    waveform: NDArray[np.float32], words: NDArray[np.float64], files: Files
) -> Iterator[Finding]:
    """Stretches of silence: those that cover words, and long ones.

    Args:
        waveform: ``(N,)`` at 16 kHz, finite.
        words: ``(W, 2)`` word intervals, s, of a transcript that fits; none where it doesn't, since
            misplaced words lie in pauses.
        files: What to call it.
    """
    level = level_db(waveform)
    lost, idle = [], []
    constant = _constant(waveform)
    hop = SAMPLE_RATE // LEVEL_HZ
    quiet = [
        (int(start), int(stop))
        for start, stop in stretches(level < SILENT_DB) * hop
        if not any(a < stop and start < b for a, b in constant)
    ]
    for start, stop in sorted(constant + quiet):
        spoken = overlap_s(words, start / SAMPLE_RATE, stop / SAMPLE_RATE)
        stretch = (start / SAMPLE_RATE, stop / SAMPLE_RATE, spoken)
        if spoken >= LOST_WORDS_S:
            lost.append(stretch)
        elif (start, stop) in constant or stop - start >= LONG_SILENCE_S * SAMPLE_RATE:
            idle.append(stretch)
    if lost:
        spoken = sum(stretch[2] for stretch in lost)
        yield Finding(
            Check.SILENT,
            Severity.ERROR,
            files.audio,
            f"silent {_where(lost)}, where the transcript has {spoken:.1f} s of words",
            "export the audio again (was it muted or lost there?), or check that the transcript"
            " is of this recording",
            time_s=lost[0][0],
        )
    if idle:
        yield Finding(
            Check.SILENT,
            Severity.WARNING,
            files.audio,
            f"silent {_where(idle)}",
            "listen there: if the speaker talks, export the audio again; blanked names and a"
            " listener's silence are no fault",
            time_s=idle[0][0],
        )


def _where(found: list[tuple[float, float, float]]) -> str:
    start, stop, _ = found[0]
    text = f"from {start:.2f} to {stop:.2f} s"
    if len(found) > 1:
        total = sum(stop - start for start, stop, _ in found)
        text += f" and in {len(found) - 1} more places, {total:.1f} s in all"
    return text


def _constant(waveform: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Samples between which the waveform does not change for `LONG_ZEROS_S`."""
    # One sample in a thousand tells where to look: a constant second holds sixteen of them.
    step = 1000
    coarse = long_stretches(np.diff(waveform[::step]) == 0, LONG_ZEROS_S * SAMPLE_RATE // step - 2)
    found = []
    for first, last in coarse * step:
        low, high = max(0, first - step), min(len(waveform), last + step + 1)
        for start, stop in stretches(np.diff(waveform[low:high]) == 0):
            if stop - start >= LONG_ZEROS_S * SAMPLE_RATE:
                found.append((low + int(start), low + int(stop) + 1))
    return found
