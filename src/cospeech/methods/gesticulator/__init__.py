"""Gesticulator (Kucherenko et al. 2020): acoustics and text to joint rotations."""

from cospeech.methods.gesticulator.module import Gesticulator
from cospeech.methods.gesticulator.published import import_published

__all__ = ["Gesticulator", "import_published"]
