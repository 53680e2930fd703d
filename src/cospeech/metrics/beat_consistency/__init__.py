"""Whether motion and speech beat together: chance-corrected, in both directions, in seconds.

A raw beat score says little: motion that never heard the speech scores 0.2 to 0.9, the more the
more it moves (`scores` has the formula). What counts is the lift over mismatched speech.

    clips = [beat_clip(name, motion, speech, MotionBeats(), StressedSyllables()), ...]
    beat_consistency(clips).motion_to_audio.lift
"""

from cospeech.metrics.beat_consistency.audio_beats import (
    AudioDetector,
    SpeechOnsets,
    StressedSyllables,
)
from cospeech.metrics.beat_consistency.consistency import (
    BeatClip,
    BeatConsistency,
    DirectedConsistency,
    beat_clip,
    beat_consistency,
    lag_profile,
)
from cospeech.metrics.beat_consistency.motion_beats import MotionBeats
from cospeech.metrics.beat_consistency.scores import SIGMA_S, beat_scores, lift

__all__ = [
    "SIGMA_S",
    "AudioDetector",
    "BeatClip",
    "BeatConsistency",
    "DirectedConsistency",
    "MotionBeats",
    "SpeechOnsets",
    "StressedSyllables",
    "beat_clip",
    "beat_consistency",
    "beat_scores",
    "lag_profile",
    "lift",
]
