"""Cospeech: an experiment framework for co-speech gesture generation."""

__version__ = "0.1.0"
