"""Long speech in chunks: cutting, word placement and stitching (spec 5)."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from cospeech.corpus.windows import WindowSpec
from cospeech.methods.trimodal.networks import POSE_SIZE
from cospeech.methods.trimodal.words import EncodedWords
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import evenly_placed_words, frame_aligned_words


def covering_frames(samples: int, fps: float) -> int:
    """Fewest frames that cover ``samples`` of 16 kHz audio: ``ceil(seconds * fps)``."""
    return math.ceil(round(samples * fps, 6) / SAMPLE_RATE)


def chunk_count(samples: int, window: WindowSpec) -> int:
    """Chunks for a waveform: 1 below one window, else ``ceil((length - window) / hop) + 1``."""
    length = window.frames / window.fps * SAMPLE_RATE
    return 1 if samples < length else math.ceil((samples - length) / _hop_samples(window)) + 1


def cut_audio(waveform: Tensor, count: int, window: WindowSpec) -> Tensor:
    """Overlapping chunks of a waveform, the tail padded with zeros as published.

    Args:
        waveform: ``(N,)`` at 16 kHz.
        count: Number of chunks.
        window: Window geometry; chunks start ``frames - seed_frames`` frames apart.

    Returns:
        ``(count, int(frames / fps * 16000))``.
    """
    hop = round(_hop_samples(window))
    length = int(window.frames / window.fps * SAMPLE_RATE)
    padded = waveform.new_zeros(max(len(waveform), (count - 1) * hop + length))
    padded[: len(waveform)] = waveform
    return padded.unfold(0, length, hop)[:count]


def _hop_samples(window: WindowSpec) -> float:
    return (window.frames - window.seed_frames) / window.fps * SAMPLE_RATE


def cut_words(words: EncodedWords, count: int, window: WindowSpec, *, timed: bool) -> Tensor:
    """Word ids of each chunk (spec 3.7), ``(count, frames)`` int64, 0 where there is no word.

    Args:
        words: Ids with their times.
        count: Number of chunks.
        window: Window geometry.
        timed: Words on their onset frames; False spreads a chunk's words evenly.
    """
    rows = np.zeros((count, window.frames), dtype=np.int64)
    for chunk, row in enumerate(rows):
        begin = chunk * (window.frames - window.seed_frames) / window.fps
        inside = (words.starts < begin + window.frames / window.fps) & (words.ends > begin)
        ids = words.ids[inside]
        row[:] = (
            frame_aligned_words(words.starts[inside], ids, begin, window.frames, window.fps)
            if timed
            else evenly_placed_words(ids, window.frames)
        )
    return torch.from_numpy(rows)


def spread_words(words: Tensor) -> Tensor:
    """Frame-aligned words without their timing: word i of n at ``(i + 1) floor(T / (n + 1))``.

    The published text-only ablation places the words of a window so (spec 3.7). A batch holds
    frame-aligned words, so one that another word on its frame has overwritten stays lost.

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


def stitch(chunks: Tensor, seed_frames: int) -> Tensor:
    """One sequence from overlapping chunks (spec 5.2).

    The last ``s`` frames of a chunk and the first ``s`` of the next blend linearly: frame j is
    ``previous (s - j) / (s + 1) + next (j + 1) / (s + 1)``.

    Args:
        chunks: ``(C, T, 27)``.
        seed_frames: Overlap ``s``.

    Returns:
        ``(T + (C - 1)(T - s), 27)``.
    """
    rise = torch.arange(1, seed_frames + 1, dtype=chunks.dtype, device=chunks.device)
    rise = (rise / (seed_frames + 1)).unsqueeze(-1)
    parts = [chunks[0]]
    for chunk in chunks[1:]:
        previous = parts.pop()
        overlap = previous[-seed_frames:] * (1 - rise) + chunk[:seed_frames] * rise
        parts += [previous[:-seed_frames], torch.cat([overlap, chunk[seed_frames:]])]
    return torch.cat(parts)


def seed_input(seeds: Tensor, frames: int) -> Tensor:
    """The generator's ``(B, frames, 28)`` seed channels: features, then 1, on the leading frames.

    Args:
        seeds: ``(B, seed_frames, 27)``; no frames at all leave everything zero (spec 5.1).
        frames: Window length.
    """
    channels = seeds.new_zeros(len(seeds), frames, POSE_SIZE + 1)
    channels[:, : seeds.shape[1], :POSE_SIZE] = seeds
    channels[:, : seeds.shape[1], POSE_SIZE] = 1
    return channels
