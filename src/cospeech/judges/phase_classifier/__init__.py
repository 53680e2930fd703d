"""The gesture phase classifier of the multi-adversary method."""

from cospeech.judges.phase_classifier.module import PhaseClassifier

__all__ = ["PhaseClassifier"]
