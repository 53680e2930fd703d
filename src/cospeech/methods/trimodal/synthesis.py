"""Motion for speech of any length (Yoon et al. 2020, section 3.3; spec 5.1-5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.methods.trimodal.chunks import (
    chunk_count,
    covering_frames,
    cut_audio,
    cut_words,
    seed_input,
    stitch,
)
from cospeech.methods.trimodal.networks import POSE_SIZE, Generator
from cospeech.methods.trimodal.style import StyleRequest, read_style_request
from cospeech.methods.trimodal.words import WordVectorFile, encode_words
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from cospeech.speech.vocabulary import Vocabulary

CHUNKS_AT_ONCE = 32
"""Chunks whose speech is encoded together; bounds the memory that a long recording takes."""


@dataclass(frozen=True)
class SynthesisOptions:
    """Settings of synthesis; False is as published.

    Attributes:
        word_timing: ``"onset"`` or ``"even"``.
        mean_style: The mean style instead of a sample.
        fixed_style: One style sample per utterance instead of one per chunk.
        unit_length: Normalised direction vectors, so that bones keep their length.
        trained_speakers_only: Never draw the untrained row 0 when no speaker is asked for.
        fold_case: Transcripts normalised as the corpus was before words are looked up.
    """

    word_timing: str
    mean_style: bool
    fixed_style: bool
    unit_length: bool
    trained_speakers_only: bool
    fold_case: bool


@dataclass(frozen=True, eq=False)
class Synthesiser:
    """A trained generator with all that turns speech into motion.

    Attributes:
        network: The generator, in eval mode.
        codec: Way back to positions.
        window: Chunk geometry.
        vocabulary: Word ids.
        vector_file: Vectors of words outside the vocabulary; None if there is no such file.
        speakers: Training speakers; speaker i has id i + 1.
        options: Quirks on or off.
    """

    network: Generator
    codec: DirectionVectorCodec
    window: WindowSpec
    vocabulary: Vocabulary
    vector_file: WordVectorFile | None
    speakers: list[str]
    options: SynthesisOptions

    @torch.no_grad()
    def __call__(
        self,
        speech: Speech,
        speaker: str | None,
        seed_motion: Motion | None,
        controls: Mapping[str, Any] | None,
        generator: torch.Generator,
    ) -> Motion:
        """See `cospeech.methods.trimodal.module.Trimodal.generate`."""
        if not np.isfinite(speech.waveform).all():
            raise CospeechError("the waveform holds NaN or infinity", "check the audio file")
        request = read_style_request(speaker, controls, self.speakers, self.network)
        device = next(self.network.parameters()).device
        seed_frames = self.window.seed_frames
        seeds = None
        if seed_motion is not None:
            check_seed_motion(seed_motion, self.window)
            positions = torch.tensor(seed_motion.positions[-seed_frames:], dtype=torch.float32)
            seeds = self.codec.encode(positions.to(device))
        samples = len(speech.waveform)
        count = chunk_count(samples, self.window)
        words = encode_words(
            speech.words, self.vocabulary, self.vector_file, fold_case=self.options.fold_case
        )
        rows = cut_words(words, count, self.window, timed=self.options.word_timing == "onset")
        extra = words.extra_vectors
        waveform = torch.tensor(speech.waveform, dtype=torch.float32)
        chunks = decode_chunks(
            self.network,
            rows.to(device),
            cut_audio(waveform, count, self.window).to(device),
            self._styles(request, count, generator, device),
            seeds,
            seed_frames,
            None if extra is None else torch.from_numpy(extra).to(device),
        )
        features = stitch(chunks, seed_frames)[: covering_frames(samples, self.window.fps)]
        positions = self.codec.decode(features, unit_length=self.options.unit_length)
        return Motion(UPPER_BODY, self.window.fps, positions.cpu().numpy())

    def _styles(
        self, request: StyleRequest, count: int, generator: torch.Generator, device: torch.device
    ) -> Tensor | None:
        """A style per chunk, ``(count, style_size)``; None without a style input."""
        size = self.network.style_size
        if self.network.style == "none":
            return None
        if request.vector is not None:
            return request.vector.to(device).expand(count, size)
        if self.network.style == "speaker" and not request.weights:
            # Drawing 0 is a published quirk: nothing ever trained row 0 (spec 1.3).
            lowest = min(1, len(self.speakers)) if self.options.trained_speakers_only else 0
            speaker = draw_speakers(1, lowest, len(self.speakers), generator)
            request = StyleRequest(None, {int(speaker): 1.0})
        noise = None
        if not self.options.mean_style:
            draws = 1 if self.options.fixed_style else count
            noise = draw_noise(draws, size, generator).to(device)
        if self.network.style == "random":
            noise = torch.zeros(1, size, device=device) if noise is None else noise
            return noise.expand(count, size)
        return request.posterior(self.network).sample(noise).expand(count, size)


def draw_speakers(count: int, lowest: int, highest: int, generator: torch.Generator) -> Tensor:
    """``(count,)`` speaker ids from ``lowest`` to ``highest``, both included."""
    return torch.randint(
        lowest, highest + 1, (count,), generator=generator, device=generator.device
    )


def draw_noise(count: int, size: int, generator: torch.Generator) -> Tensor:
    """``(count, size)`` standard normal draws, on the generator's device."""
    return torch.randn(count, size, generator=generator, device=generator.device)


def decode_chunks(
    generator: Generator,
    words: Tensor,
    audio: Tensor,
    styles: Tensor | None,
    seeds: Tensor | None,
    seed_frames: int,
    extra_vectors: Tensor | None = None,
) -> Tensor:
    """Poses of consecutive chunks, each continuing from the raw end of the one before.

    Args:
        generator: The network, in eval mode.
        words: ``(C, T)`` word ids.
        audio: ``(C, N)`` waveforms.
        styles: ``(C, style_size)``, one style per chunk; None for a generator without style.
        seeds: ``(seed_frames, 27)`` features that the first chunk continues from, or None.
        seed_frames: Frames a chunk takes from the one before.
        extra_vectors: ``(E, word_size)`` of the ids beyond the vocabulary.

    Returns:
        ``(C, T, 27)``.
    """
    chunks: list[Tensor] = []
    previous = audio.new_zeros(1, 0, POSE_SIZE) if seeds is None else seeds.unsqueeze(0)
    for first in range(0, len(words), CHUNKS_AT_ONCE):
        group = slice(first, first + CHUNKS_AT_ONCE)
        # Only the decoder needs the chunk before; speech is encoded for many chunks at once.
        speech = generator.encode_speech(words[group], audio[group], extra_vectors)
        for offset, features in enumerate(speech.split(1)):
            style = None if styles is None else styles[first + offset].unsqueeze(0)
            poses = generator.decode(seed_input(previous, words.shape[1]), features, style)
            chunks.append(poses)
            previous = poses[:, -seed_frames:]
    return torch.cat(chunks)


def check_seed_motion(motion: Motion, window: WindowSpec) -> None:
    """Refuse a seed that the method can't continue from.

    Raises:
        CospeechError: Wrong joints, wrong frame rate, too short, or NaN among the frames used.
    """
    if motion.skeleton.joints != UPPER_BODY.joints:
        raise CospeechError(
            f"the seed motion is on skeleton {motion.skeleton.name!r}, not the upper body",
            "map it with cospeech.motion.upper_body.to_upper_body",
        )
    if abs(motion.fps - window.fps) > 1e-6:
        raise CospeechError(
            f"the seed motion runs at {motion.fps:g} fps, the method at {window.fps:g}",
            "resample it with cospeech.motion.motion.resample_positions",
        )
    if len(motion) < window.seed_frames:
        raise CospeechError(
            f"the seed motion has {len(motion)} frames, {window.seed_frames} are needed"
        )
    if not np.isfinite(motion.positions[-window.seed_frames :]).all():
        raise CospeechError(
            f"the seed motion's last {window.seed_frames} frames hold NaN or infinity"
        )
