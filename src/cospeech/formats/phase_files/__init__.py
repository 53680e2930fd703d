"""Gesture phases from annotation files: ANVIL, ELAN and plain tables."""

from cospeech.formats.phase_files.reader import read_phases
from cospeech.motion.phases import PhaseSegment, frame_phases

__all__ = ["PhaseSegment", "frame_phases", "read_phases"]
