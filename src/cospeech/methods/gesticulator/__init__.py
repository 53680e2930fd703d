"""Gesticulator (Kucherenko et al. 2020): acoustics and text to joint rotations."""

from cospeech.methods.gesticulator.module import Gesticulator

__all__ = ["Gesticulator"]
