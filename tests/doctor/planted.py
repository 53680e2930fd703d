"""Clean recordings, ways to break them, and what to expect of the doctor."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from cospeech.corpus.recording import Recording
from cospeech.corpus.synthetic import build_take, plan
from cospeech.doctor import Check, Finding, Severity
from cospeech.motion.bvh import write_bvh
from cospeech.speech.speech import Speech, Word
from cospeech.speech.tts import speak_all
from tests.fabricated.sound import save_wav

ARMS = tuple(
    (f"Left{joint}", f"Right{joint}")
    for joint in (
        "Shoulder", "Arm", "ForeArm", "Hand",
        *(f"Hand{finger}{i}" for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky")
          for i in ("1", "2", "3", "3_end")),
    )
)  # fmt: skip
LEGS = tuple(
    (f"Left{joint}", f"Right{joint}")
    for joint in ("UpLeg", "Leg", "Foot", "ForeFoot", "ToeBase", "ToeBase_end")
)


def make_takes(count: int, minutes: float, seed: int = 7) -> list[Recording]:
    """The first takes of an embedded corpus; one of an hour has takes of about 75 s."""
    takes = plan(minutes, seed)[:count]
    spoken = speak_all([(line.sentence.text, line.voice) for take in takes for line in take.lines])
    return [build_take(take, [next(spoken) for _ in take.lines]) for take in takes]


def the_error(findings: list[Finding], check: Check, time_s: float | None = None) -> Finding:
    """The finding, which must be the only error; at a time, to 0.2 s."""
    errors = [finding for finding in findings if finding.severity is Severity.ERROR]
    assert [finding.check for finding in errors] == [check], errors
    if time_s is not None:
        assert errors[0].time_s is not None
        assert abs(errors[0].time_s - time_s) < 0.2
    assert errors[0].next_step
    return errors[0]


def the_warning(findings: list[Finding], check: Check, time_s: float | None = None) -> Finding:
    """The only warning of a check, among no errors."""
    assert not [finding for finding in findings if finding.severity is Severity.ERROR], findings
    (warning,) = [f for f in findings if (f.check, f.severity) == (check, Severity.WARNING)]
    if time_s is not None:
        assert warning.time_s is not None
        assert abs(warning.time_s - time_s) < 0.2
    return warning


def with_waveform(recording: Recording, waveform: np.ndarray) -> Recording:
    """The recording with other audio."""
    speech = Speech(waveform.astype(np.float32), recording.speech.words)
    return replace(recording, speech=speech)


def with_words(recording: Recording, words) -> Recording:
    """The recording with other words."""
    return replace(recording, speech=Speech(recording.speech.waveform, tuple(words)))


def moved_words(recording: Recording, offset_s: float = 0.0, rate: float = 1.0) -> list[Word]:
    """Its words at ``rate * time + offset``."""
    return [
        Word(word.text, rate * word.start + offset_s, rate * word.end + offset_s)
        for word in recording.speech.words or ()
    ]


def with_positions(recording: Recording, positions: np.ndarray) -> Recording:
    """The recording with other positions, and no rotations."""
    motion = replace(recording.motion, positions=positions.astype(np.float32), rotations_local=None)
    return replace(recording, motion=motion)


def exchanged(recording: Recording, pairs, frames: slice = slice(None)) -> np.ndarray:
    """Positions with the joints of each pair exchanged in some frames."""
    positions, index = recording.motion.positions.copy(), recording.motion.skeleton.index
    for left, right in pairs:
        both = [index[left], index[right]]
        positions[frames, both[0]], positions[frames, both[1]] = (
            recording.motion.positions[frames, both[1]],
            recording.motion.positions[frames, both[0]],
        )
    return positions


def write_folder(folder: Path, recordings: list[Recording]) -> None:
    """BVH, wav and word table of each recording, side by side."""
    for recording in recordings:
        write_bvh(folder / f"{recording.id}.bvh", recording.motion)
        save_wav(folder / f"{recording.id}.wav", recording.speech.waveform)
        write_words(folder / f"{recording.id}.tsv", recording.speech.words)


def write_words(path: Path, words) -> None:
    """A table of start, end and word."""
    lines = [f"{word.start:.3f}\t{word.end:.3f}\t{word.text}\n" for word in words]
    path.write_text("".join(lines))
