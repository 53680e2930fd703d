"""Milliseconds per 60 s of speech: our acoustic features beside librosa, in one run.

    python benchmarks/speech_features.py [--seconds 60] [--repeats 5]

Each line is the best of the repeats after one call that is not counted (librosa compiles in it),
on one thread. The last line is the table as JSON.
"""

import argparse
import json
import platform
import time
from collections.abc import Callable
from importlib import metadata

import librosa
import numpy as np
import torch

from cospeech.speech.features import CEPSTRAL_MEL, TRIMODAL_MEL, energy, log_mel, mfcc
from cospeech.speech.pitch import SPEECH_PITCH, f0
from cospeech.speech.speech import SAMPLE_RATE


def voice(seconds: float) -> np.ndarray:
    """A buzz of wandering pitch that comes and goes four times a second, and some noise."""
    time_s = np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE
    phase = 2 * np.pi * np.cumsum(140 + 40 * np.sin(0.9 * time_s)) / SAMPLE_RATE
    buzz = sum(np.cos(k * phase) / k for k in range(1, 9))
    syllables = np.clip(np.sin(2 * np.pi * 4 * time_s), 0, None)
    noise = np.random.default_rng(0).normal(size=len(time_s))
    return (0.1 * buzz * syllables + 0.002 * noise).astype(np.float32)


def librosa_log_mel(waveform: np.ndarray) -> np.ndarray:
    """The same spectrogram by librosa."""
    spec = TRIMODAL_MEL
    power = librosa.feature.melspectrogram(
        y=waveform, sr=SAMPLE_RATE, n_fft=spec.fft_samples, hop_length=spec.hop_samples
    )
    return librosa.power_to_db(power, ref=np.max)


def librosa_mfcc(waveform: np.ndarray) -> np.ndarray:
    """The same coefficients by librosa."""
    spec = CEPSTRAL_MEL
    return librosa.feature.mfcc(
        y=waveform,
        sr=SAMPLE_RATE,
        n_mfcc=13,
        n_fft=spec.fft_samples,
        hop_length=spec.hop_samples,
        n_mels=spec.bands,
        fmin=spec.lowest_hz,
        fmax=spec.highest_hz,
    )


def librosa_energy(waveform: np.ndarray) -> np.ndarray:
    """RMS in dB by librosa."""
    rms = librosa.feature.rms(y=waveform, frame_length=640, hop_length=160)[0]
    return librosa.amplitude_to_db(rms, ref=1.0, top_db=None)


def librosa_f0(waveform: np.ndarray) -> np.ndarray:
    """Pitch with a voicing decision by librosa: pYIN."""
    spec = SPEECH_PITCH
    return librosa.pyin(
        waveform,
        fmin=spec.lowest_hz,
        fmax=spec.highest_hz,
        sr=SAMPLE_RATE,
        hop_length=spec.hop_samples,
        frame_length=1024,
    )[0]


PAIRS: dict[str, tuple[Callable, Callable]] = {
    "log_mel": (log_mel, librosa_log_mel),
    "mfcc": (mfcc, librosa_mfcc),
    "energy": (energy, librosa_energy),
    "f0": (f0, librosa_f0),
}


def best_ms(function: Callable, waveform: np.ndarray, repeats: int) -> float:
    """Shortest of the repeats, after one call that is not counted."""
    function(waveform)
    elapsed = []
    for _ in range(repeats):
        start = time.perf_counter()
        function(waveform)
        elapsed.append(time.perf_counter() - start)
    return 1000 * min(elapsed)


def main() -> None:
    """Time every feature both ways and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the audio")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    waveform = voice(arguments.seconds)
    rows = []
    print(f"{'feature':10}{'ours, ms':>12}{'librosa, ms':>14}{'ratio':>8}{'difference':>16}")
    for name, (ours, theirs) in PAIRS.items():
        difference = float(np.nanmedian(np.abs(ours(waveform) - theirs(waveform))))
        ours_ms = best_ms(ours, waveform, arguments.repeats)
        theirs_ms = best_ms(theirs, waveform, 1 if name == "f0" else arguments.repeats)
        ratio = theirs_ms / ours_ms
        print(f"{name:10}{ours_ms:12.1f}{theirs_ms:14.1f}{ratio:8.1f}{difference:16.2g}")
        rows.append(
            {
                "feature": name,
                "ours_ms": round(ours_ms, 2),
                "librosa_ms": round(theirs_ms, 2),
                "median_difference": difference,
            }
        )
    machine = {
        "seconds_of_audio": arguments.seconds,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "librosa": metadata.version("librosa"),
        "processor": platform.machine(),
    }
    print(json.dumps(machine | {"features": rows}))


if __name__ == "__main__":
    main()
