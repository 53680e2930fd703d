"""Transcripts that are late, run apart from the audio, or belong to another recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.lengths import KNOWN_RATIOS
from cospeech.doctor.word_fit import Fit, fit_words, is_judgeable

SHIFT_S, FAR_SHIFT_S = 0.12, 0.2
"""Shift of the words that is mentioned and that is an error, s. Aligners and hand corrections
differ by up to 0.05 s; at 0.2 s a stroke belongs to another syllable."""

BETTER = 0.15
"""Correlation gained by shifting from which the words are not in their place. Transcripts that fit
gain up to 0.02."""

FITS = 0.4
"""Correlation that a transcript in its place reaches: 0.5 to 0.9 on clean recordings."""

DISTINCT = 0.2
"""Lead of the best shift over all others from which it is the true one."""

DOUBTFUL, WRONG = 0.3, 0.15
"""Correlations below which a transcript that fits nowhere is mentioned, and is an error."""

SURE_WORDS, SURE_S = 30, 14.0
"""Words, and seconds from the first to the last, from which "fits nowhere" is an error; in less,
music, laughter or interpolated times look the same."""

DRIFT_S = 0.2
"""Difference between the shifts of the first and last third that is drift, s."""

DRIFT_GAIN = 0.03
"""Correlation gained by taking the drift out, at least."""

KNOWN_DRIFT_S = 40.0
"""Length of the words from which drift at a known wrong rate is looked for, s."""

THIRD_WORDS, THIRD_S, THIRD_GAPS_S = 12, 6.0, 1.0
"""What a third of a recording needs so that its shift means something."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """A transcript that does not fit, kept until the corpus's others are known.

    Attributes:
        level: The audio's level curve, dB.
        fit: How its own words fit.
    """

    level: NDArray[np.float32]
    fit: Fit


@dataclass(frozen=True, eq=False)
class Verdict:
    """What is thought of a transcript.

    Attributes:
        findings: At most one.
        doubt: Where the transcript may be that of another recording: what is found then says
            otherwise only until `find_owner` has looked.
        misplaced: Whether the words are known to be elsewhere, so that words beyond an end of the
            audio are no fault of their own.
    """

    findings: list[Finding]
    doubt: Doubt | None = None
    misplaced: bool = False


def check_transcript(
    level: NDArray[np.float64], intervals: NDArray[np.float64], files: Files
) -> Verdict:
    """Whether the words are where the speech is.

    Args:
        level: ``(N,)`` dB, of the whole audio.
        intervals: ``(W, 2)`` starts and ends of words, s.
        files: What to call them.
    """
    fit = fit_words(level, intervals) if is_judgeable(intervals) else None
    if fit is None:
        return Verdict([])
    drift = _drift(level, intervals, fit) or _known_drift(level, intervals, fit)
    if drift is not None:
        doubt = Doubt(level.astype(np.float32), replace(fit, best=drift.mended))
        return Verdict([_drift_finding(drift, files)], doubt, misplaced=True)
    gain = fit.best - fit.at_zero
    distinct = fit.best - fit.runner_up > DISTINCT
    if fit.best >= FITS and distinct and abs(fit.shift_s) >= SHIFT_S and gain > BETTER:
        doubt = Doubt(level.astype(np.float32), fit)
        return Verdict([_shift_finding(fit, files)], doubt, misplaced=True)
    if fit.at_zero >= FITS or (fit.at_zero >= DOUBTFUL and gain < BETTER):
        return Verdict([])
    sure = is_judgeable(intervals, least_words=SURE_WORDS, least_s=SURE_S)
    wrong = sure and (gain > BETTER or fit.at_zero < WRONG)
    finding = Finding(
        Check.TRANSCRIPT,
        Severity.ERROR if wrong else Severity.WARNING,
        files.words,
        f"the words do not lie where the speech is: correlation of speech level and words"
        f" {fit.at_zero:.2f}, and no shift up to 5 s mends it (0.5 to 0.9 is usual)",
        f"listen to {files.audio} with the transcript: is it of another recording? If it is right,"
        " align it again (music or noise can also hide the speech)",
    )
    return Verdict([finding], Doubt(level.astype(np.float32), fit))


def find_owner(
    doubt: Doubt, others: Sequence[tuple[str, NDArray[np.float64]]]
) -> tuple[str, float] | None:
    """The transcript of another recording that fits this audio.

    Args:
        doubt: Of the recording.
        others: File name and word intervals of the other transcripts.

    Returns:
        Its file and correlation; None where none fits better than the recording's own at any shift.
    """
    level = doubt.level.astype(np.float64)
    best: tuple[str, float] | None = None
    for name, intervals in others:
        if not is_judgeable(intervals):
            continue
        fit = fit_words(level, intervals, SHIFT_S)
        if fit is not None and (best is None or fit.best > best[1]):
            best = (name, fit.best)
    if best is None or best[1] < FITS or best[1] < doubt.fit.best + 0.05:
        return None
    return best


def owner_finding(files: Files, owner: str, correlation: float, own: Fit) -> Finding:
    """Says that a transcript of another recording fits."""
    return Finding(
        Check.TRANSCRIPT,
        Severity.ERROR,
        files.words,
        f"the words do not fit {files.audio} (correlation {own.at_zero:.2f}); those of {owner} do"
        f" ({correlation:.2f})",
        "the two transcripts, or the two recordings, have each other's name: rename them",
    )


@dataclass(frozen=True)
class _Drift:
    """What the words need: ``time + first_s`` at their start, ``time + last_s`` at their end."""

    first_s: float
    last_s: float
    length_s: float
    mended: float


def _shift_finding(fit: Fit, files: Files) -> Finding:
    late = "late" if fit.shift_s < 0 else "early"
    return Finding(
        Check.TRANSCRIPT,
        Severity.ERROR if abs(fit.shift_s) >= FAR_SHIFT_S else Severity.WARNING,
        files.words,
        f"the words come {abs(fit.shift_s):.2f} s too {late}: correlation with the speech level is"
        f" {fit.at_zero:.2f}, and {fit.best:.2f} when they are shifted by {fit.shift_s:+.2f} s",
        f"add {fit.shift_s:+.2f} s to all word times, or find out which of audio and transcript was"
        " cut at its start",
    )


def _drift(level: NDArray[np.float64], intervals: NDArray[np.float64], whole: Fit) -> _Drift | None:
    """Drift by the shifts of three thirds; None without."""
    start, end = float(intervals[:, 0].min()), float(intervals[:, 1].max())
    middles = intervals.mean(axis=1)
    third = (end - start) / 3
    centres, shifts = [], []
    for i in range(3):
        part = intervals[(middles >= start + i * third) & (middles <= start + (i + 1) * third)]
        if not is_judgeable(
            part, least_words=THIRD_WORDS, least_s=THIRD_S, least_gaps_s=THIRD_GAPS_S
        ):
            return None
        fit = fit_words(level, part)
        if fit is None or fit.best < FITS:
            return None
        centres.append(start + (i + 0.5) * third)
        shifts.append(fit.shift_s)
    if abs(shifts[2] - shifts[0]) < DRIFT_S:
        return None
    rate, offset = np.polyfit(centres, shifts, 1)
    # Three shifts found in noise would not make the whole fit better.
    mended = fit_words(level, intervals + (rate * intervals + offset))
    if mended is None or mended.at_zero < max(FITS, whole.best + DRIFT_GAIN):
        return None
    first, last = float(rate * start + offset), float(rate * end + offset)
    return _Drift(first, last, end - start, mended.at_zero)


def _known_drift(
    level: NDArray[np.float64], intervals: NDArray[np.float64], whole: Fit
) -> _Drift | None:
    """As `_drift`, for drifts so fast that no third fits: those of known wrong rates."""
    # In a few words, one of a dozen rates and a thousand shifts fits by chance.
    if whole.at_zero >= FITS or not is_judgeable(intervals, least_s=KNOWN_DRIFT_S):
        return None
    best: _Drift | None = None
    highest = max(FITS, whole.best + BETTER)
    start, end = float(intervals[:, 0].min()), float(intervals[:, 1].max())
    for ratio, _ in KNOWN_RATIOS:
        fit = fit_words(level, ratio * intervals)
        if fit is not None and fit.best > highest and fit.best - fit.runner_up > DISTINCT:
            highest = fit.best
            first, last = ((ratio - 1) * time + fit.shift_s for time in (start, end))
            best = _Drift(first, last, end - start, fit.best)
    return best


def _drift_finding(drift: _Drift, files: Files) -> Finding:
    ratio = 1 + (drift.last_s - drift.first_s) / drift.length_s
    return Finding(
        Check.DRIFT,
        Severity.ERROR,
        files.words,
        f"words and audio run apart: the words need {drift.first_s:+.2f} s at their start and"
        f" {drift.last_s:+.2f} s at their end",
        f"multiply the word times by {ratio:.5f} after adding the offset of the start, or find"
        " which of audio and transcript was made at another rate",
    )
