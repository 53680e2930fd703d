"""Multi-adversary GAN with gesture phases (Ferstl, Neff, McDonnell 2020)."""

from __future__ import annotations

from cospeech.methods.multi_adversary.module import MultiAdversary

__all__ = ["MultiAdversary"]
