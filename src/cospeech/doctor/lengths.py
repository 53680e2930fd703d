"""Audio and motion that last differently long: cut ends, and clocks that run apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.doctor.findings import Check, Files, Finding, Severity

DIFFERENT_S, VERY_DIFFERENT_S = 0.25, 1.0
"""Difference that is mentioned and that is an error, s. Recorders are stopped one after another;
a quarter of a second is a handful of frames."""

VERY_DIFFERENT_SHARE = 0.05
"""The same for short takes, as a share of the longer: speech and gesture of a take that is half a
second short of ten are still in time."""

RATIO_FRAMES = 1.5
"""How exactly a known wrong rate must explain the lengths, motion frames: both ends are rounded to
a frame."""

SAME_CLOCK_RECORDINGS = 4
"""Recordings that must agree on one ratio before the corpus's clock is called wrong."""

KNOWN_RATIOS: tuple[tuple[float, str], ...] = (
    (1000 / 1001, "29.97 for 30 or 14.985 for 15 fps"),
    (1001 / 1000, "30 for 29.97 or 15 for 14.985 fps"),
    (24 / 25, "frames of 24 fps read at 25"),
    (25 / 24, "frames of 25 fps read at 24"),
    (25 / 30, "frames of 25 fps read at 30"),
    (30 / 25, "frames of 30 fps read at 25"),
    (24 / 30, "frames of 24 fps read at 30"),
    (30 / 24, "frames of 30 fps read at 24"),
    (50 / 60, "frames of 50 fps read at 60"),
    (44.1 / 48, "audio of 48 kHz read at 44.1 kHz"),
    (48 / 44.1, "audio of 44.1 kHz read at 48 kHz"),
    (16 / 22.05, "audio of 22.05 kHz read at 16 kHz"),
    (22.05 / 16, "audio of 16 kHz read at 22.05 kHz"),
    (0.5, "every frame counted as two, or audio at half its rate"),
    (2.0, "every second frame left out, or audio at twice its rate"),
)
"""Motion length over audio length when one of the two is read at a wrong rate."""


@dataclass(frozen=True)
class Lengths:
    """How long the two parts of a recording are before anything is cut.

    Attributes:
        motion_s: Seconds of motion.
        audio_s: Seconds of audio.
        fps: Frame rate of the motion.
    """

    motion_s: float
    audio_s: float
    fps: float

    @property
    def difference_s(self) -> float:
        """Motion minus audio, s."""
        return self.motion_s - self.audio_s


def check_lengths(lengths: Lengths, files: Files) -> Iterator[Finding]:
    """Whether audio and motion last equally long, and if not, whether a wrong rate explains it.

    Args:
        lengths: Of the uncut recording.
        files: What to call them.
    """
    difference = lengths.difference_s
    longer, shorter = max(lengths.motion_s, lengths.audio_s), min(lengths.motion_s, lengths.audio_s)
    if abs(difference) < DIFFERENT_S or shorter <= 0:
        return
    # Within a second, a short tail and a small drift look the same.
    far = abs(difference) > VERY_DIFFERENT_S or abs(difference) > VERY_DIFFERENT_SHARE * longer
    severity = Severity.ERROR if far else Severity.WARNING
    says = f"the motion lasts {lengths.motion_s:.2f} s, the audio ({files.audio})"
    says += f" {lengths.audio_s:.2f} s"
    reason = _known_ratio(lengths)
    if reason is not None:
        yield Finding(
            Check.DRIFT,
            severity,
            files.motion,
            f"{says}: a ratio of {lengths.motion_s / lengths.audio_s:.4f}, as {reason}",
            "compare a clap or a stressed gesture near the end: if it is out of time, set the"
            f" true rate (data.frame_rate={_true_rate(lengths):.6g}), or export the audio at"
            " its true rate; if it is in time, the longer one just goes on",
            time_s=shorter,
        )
        return
    yield Finding(
        Check.LENGTHS,
        severity,
        files.motion,
        f"{says}: {abs(difference):.2f} s of {'motion' if difference > 0 else 'audio'} are"
        " without the other",
        "check by a clap or the first gesture that both start at the same moment; if they do,"
        " the end is cut off and nothing needs doing, else trim the start of the longer",
        time_s=shorter,
    )


def check_clock(recordings: Sequence[tuple[Lengths, Files]]) -> Iterator[Finding]:
    """Whether all recordings of a corpus share one ratio of lengths, so that its clock is wrong.

    One take that is half a second short may be cut; twenty takes that are each a thousandth short
    are not.

    Args:
        recordings: Uncut lengths of the corpus's recordings.
    """
    if len(recordings) < SAME_CLOCK_RECORDINGS:
        return
    audio = np.array([lengths.audio_s for lengths, _ in recordings])
    motion = np.array([lengths.motion_s for lengths, _ in recordings])
    frame = np.array([RATIO_FRAMES / lengths.fps for lengths, _ in recordings])
    if audio.min() <= 0:
        return
    ratio = float((audio * motion).sum() / (audio * audio).sum())
    told_apart = np.abs(motion - audio) > 2 * frame
    if not told_apart.any() or (np.abs(motion - ratio * audio) > frame).any():
        return
    worst = int(np.abs(motion - audio).argmax())
    lengths, files = recordings[worst]
    yield Finding(
        Check.DRIFT,
        Severity.ERROR,
        files.motion,
        f"in all {len(recordings)} recordings the motion lasts {ratio:.5f} of the audio, to the"
        f" frame: one of the clocks is wrong, by {abs(lengths.difference_s):.2f} s at the end"
        " of this one",
        f"set the true frame rate, data.frame_rate={ratio * lengths.fps:.6g}",
        time_s=min(lengths.motion_s, lengths.audio_s),
    )


def _known_ratio(lengths: Lengths) -> str | None:
    tolerance = RATIO_FRAMES / lengths.fps
    errors = [abs(lengths.motion_s - ratio * lengths.audio_s) for ratio, _ in KNOWN_RATIOS]
    best = int(np.argmin(errors))
    if errors[best] > tolerance or abs(lengths.difference_s) < 4 * tolerance:
        return None
    return KNOWN_RATIOS[best][1]


def _true_rate(lengths: Lengths) -> float:
    return lengths.fps * lengths.motion_s / lengths.audio_s
