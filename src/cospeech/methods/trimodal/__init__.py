"""Trimodal gesture generation (Yoon et al. 2020): text, audio and speaker to motion."""

from cospeech.methods.trimodal.module import Trimodal
from cospeech.methods.trimodal.published import (
    import_published,
    import_published_discriminator,
)

__all__ = ["Trimodal", "import_published", "import_published_discriminator"]
