"""Long speech in chunks: cutting, word placement and blending.

See docs/facts/trimodal.md, section 5.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.windows import WindowSpec
from cospeech.methods.trimodal.networks import POSE_SIZE
from cospeech.methods.trimodal.words import EncodedWords
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import evenly_placed_words, frame_aligned_words


def hop_samples(window: WindowSpec) -> int:
    """Samples from the start of one chunk to the next, ``frames - seed_frames`` frames."""
    return round((window.frames - window.seed_frames) / window.fps * SAMPLE_RATE)


def chunk_audio(sound: NDArray[np.float32], window: WindowSpec) -> Tensor:
    """The waveform of one chunk, the tail padded with zeros as published.

    Args:
        sound: ``(N,)`` at 16 kHz from the chunk's start on.
        window: Window geometry.

    Returns:
        ``(int(frames / fps * 16000),)``.
    """
    length = int(window.frames / window.fps * SAMPLE_RATE)
    padded = np.zeros(length, dtype=np.float32)
    padded[: len(sound)] = sound[:length]
    return torch.from_numpy(padded)


def chunk_words(words: EncodedWords, chunk: int, window: WindowSpec, *, timed: bool) -> Tensor:
    """Word ids of one chunk, ``(frames,)`` int64, 0 where there is no word.

    See docs/facts/trimodal.md, section 3.7.

    Args:
        words: Ids with their times.
        chunk: Number of the chunk, from 0.
        window: Window geometry.
        timed: Words on their onset frames; False spreads a chunk's words evenly.
    """
    begin = chunk * (window.frames - window.seed_frames) / window.fps
    inside = (words.starts < begin + window.frames / window.fps) & (words.ends > begin)
    ids = words.ids[inside]
    row = (
        frame_aligned_words(words.starts[inside], ids, begin, window.frames, window.fps)
        if timed
        else evenly_placed_words(ids, window.frames)
    )
    return torch.from_numpy(row)


def spread_words(words: Tensor) -> Tensor:
    """Frame-aligned words without their timing: word i of n at ``(i + 1) floor(T / (n + 1))``.

    The published text-only ablation places the words of a window so (docs/facts/trimodal.md,
    section 3.7). A batch holds frame-aligned words, so one that another word on its frame has
    overwritten stays lost.

    Args:
        words: ``(B, T)`` ids, 0 where there is no word.
    """
    frames = words.shape[1]
    present = words != 0
    step = frames // (present.sum(dim=1, keepdim=True) + 1)
    places = (present.cumsum(dim=1) * step)[present]
    rows = present.nonzero()[:, 0]
    spread = torch.zeros_like(words)
    spread[rows, places] = words[present]
    return spread


def blend(previous: Tensor, following: Tensor) -> Tensor:
    """The overlap of two chunks: the first fades linearly into the second.

    See docs/facts/trimodal.md, section 5.2.

    Frame j of s is ``previous (s - j) / (s + 1) + following (j + 1) / (s + 1)``.

    Args:
        previous: ``(s, 27)``, the end of a chunk.
        following: ``(s, 27)``, the beginning of the next.
    """
    count = len(previous)
    rise = torch.arange(1, count + 1, dtype=previous.dtype, device=previous.device)
    rise = (rise / (count + 1)).unsqueeze(-1)
    return previous * (1 - rise) + following * rise


def seed_input(seeds: Tensor, frames: int) -> Tensor:
    """The generator's ``(B, frames, 28)`` seed channels: features, then 1, on the leading frames.

    Args:
        seeds: ``(B, seed_frames, 27)``; no frames at all leave everything zero
            (docs/facts/trimodal.md, section 5.1).
        frames: Window length.
    """
    channels = seeds.new_zeros(len(seeds), frames, POSE_SIZE + 1)
    channels[:, : seeds.shape[1], :POSE_SIZE] = seeds
    channels[:, : seeds.shape[1], POSE_SIZE] = 1
    return channels
