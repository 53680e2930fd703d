"""Write waveforms as sound files."""

from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from cospeech.speech.speech import SAMPLE_RATE


def save_wav(path: Path, waveform: NDArray[np.floating]) -> None:
    """A mono 16 kHz PCM16 wav; a sample becomes ``round(32768 * x)`` as far as 16 bits go."""
    steps = np.clip(np.rint(waveform * 32768.0), -32768, 32767).astype(np.int16)
    soundfile.write(path, steps, SAMPLE_RATE, subtype="PCM_16")
