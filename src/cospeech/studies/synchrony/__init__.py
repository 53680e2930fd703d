"""Table 3 of Habibie et al. 2022 (naturalness and synchrony of uncontrolled gestures), measured."""

from cospeech.studies.synchrony.study import SpeechToMotion, synchrony

__all__ = ["SpeechToMotion", "synchrony"]
