"""Motion for speech of any length (Yoon et al. 2020, section 3.3).

See docs/facts/trimodal.md, sections 5.1 to 5.2.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.windows import WindowSpec
from cospeech.methods.streams import Stream
from cospeech.methods.trimodal.chunks import (
    blend,
    chunk_audio,
    chunk_words,
    hop_samples,
    seed_input,
)
from cospeech.methods.trimodal.networks import Generator
from cospeech.methods.trimodal.style import StyleRequest
from cospeech.methods.trimodal.words import (
    EncodedWords,
    WordVectorFile,
    encode_words,
    joined_words,
)
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.nn.modes import evaluating
from cospeech.speech.speech import SAMPLE_RATE, Word, covering_frames
from cospeech.speech.vocabulary import Vocabulary

logger = logging.getLogger(__name__)


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


class Styles:
    """A style for each chunk.

    Args:
        request: What was asked for.
        voice: The generator and its options.
        generator: Draws a speaker where none is asked for, and noise.
    """

    def __init__(
        self, request: StyleRequest, voice: Synthesiser, generator: torch.Generator
    ) -> None:
        self._network, self._generator = voice.network, generator
        options, style = voice.options, voice.network.style
        if style == "speaker" and request.vector is None and not request.weights:
            # Drawing 0 is a published quirk: nothing ever trained row 0 (docs/facts/trimodal.md,
            # section 1.3).
            lowest = min(1, len(voice.speakers)) if options.trained_speakers_only else 0
            drawn = draw_speakers(1, lowest, len(voice.speakers), generator)
            request = StyleRequest(None, {int(drawn): 1.0})
        self._request = request
        self._draws = style != "none" and request.vector is None and not options.mean_style
        self._fixed = self._noise() if options.fixed_style else None

    def next(self) -> Tensor | None:
        """The next chunk's, ``(1, style_size)``; None without a style input."""
        network, request = self._network, self._request
        if network.style == "none":
            return None
        device = next(network.parameters()).device
        if request.vector is not None:
            return request.vector.to(device).unsqueeze(0)
        noise = self._noise() if self._fixed is None else self._fixed
        noise = None if noise is None else noise.to(device)
        if network.style == "random":
            return torch.zeros(1, network.style_size, device=device) if noise is None else noise
        return request.posterior(network).sample(noise)

    def _noise(self) -> Tensor | None:
        return draw_noise(1, self._network.style_size, self._generator) if self._draws else None


class Chunks(Stream):
    """Motion chunk by chunk, each continuing from the raw end of the one before.

    A chunk is made when all of its sound is there, and its last frames wait for the next one,
    whose beginning they blend with. Only sound and words of the chunk under way are held.

    Args:
        voice: The generator and what belongs to it.
        styles: A style for each chunk.
        seeds: ``(seed_frames, 27)`` features that the first chunk continues from, or no frames.
    """

    def __init__(self, voice: Synthesiser, styles: Styles, seeds: Tensor) -> None:
        window_s = voice.window.frames / voice.window.fps
        super().__init__(window_s, window_s, words_look_ahead_s=window_s)
        self._voice, self._styles, self._previous = voice, styles, seeds
        self._sound = np.zeros(0, dtype=np.float32)
        self._words: list[EncodedWords] = []
        self._has_words = False
        self._made = self._samples = self._put_out = 0

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion | None:
        voice, window = self._voice, self._voice.window
        if words:
            found = encode_words(
                words, voice.vocabulary, voice.vector_file, fold_case=voice.options.fold_case
            )
            self._words.append(found)
            self._has_words = True
        self._samples += len(samples)
        self._sound = np.concatenate([self._sound, samples])
        parts = []
        while len(self._sound) >= window.frames / window.fps * SAMPLE_RATE:
            parts.append(self._next_chunk()[: -window.seed_frames])
            self._sound = self._sound[hop_samples(window) :]
        return self._motion(torch.cat(parts)) if parts else None

    def _end(self) -> Motion:
        if not self._has_words:
            logger.warning("no transcript: every word is padding")
        frames = covering_frames(self._samples, self._voice.window.fps)
        return self._motion(self._next_chunk()[: frames - self._put_out])

    def _next_chunk(self) -> Tensor:
        """``(T, 27)``: the next chunk, its beginning blended with the end of the one before."""
        voice, window, previous = self._voice, self._voice.window, self._previous
        begin_s = self._made * hop_samples(window) / SAMPLE_RATE
        self._words = [part for part in self._words if (part.ends > begin_s).any()]
        words = joined_words(self._words, len(voice.vocabulary))
        row = chunk_words(words, self._made, window, timed=voice.options.word_timing == "onset")
        extra = words.extra_vectors
        device = previous.device
        with evaluating(voice.network):
            speech = voice.network.encode_speech(
                row.unsqueeze(0).to(device),
                chunk_audio(self._sound, window).unsqueeze(0).to(device),
                None if extra is None else torch.from_numpy(extra).to(device),
            )
            seeds = seed_input(previous.unsqueeze(0), window.frames)
            (poses,) = voice.network.decode(seeds, speech, self._styles.next())
        self._previous = poses[-window.seed_frames :]
        if self._made:
            overlap = blend(previous, poses[: window.seed_frames])
            poses = torch.cat([overlap, poses[window.seed_frames :]])
        self._made += 1
        return poses

    def _motion(self, features: Tensor) -> Motion:
        voice = self._voice
        self._put_out += len(features)
        positions = voice.codec.decode(features, unit_length=voice.options.unit_length)
        return Motion(UPPER_BODY, voice.window.fps, positions.cpu().numpy())


def draw_speakers(count: int, lowest: int, highest: int, generator: torch.Generator) -> Tensor:
    """``(count,)`` speaker ids from ``lowest`` to ``highest``, both included."""
    return torch.randint(
        lowest, highest + 1, (count,), generator=generator, device=generator.device
    )


def draw_noise(count: int, size: int, generator: torch.Generator) -> Tensor:
    """``(count, size)`` standard normal draws, on the generator's device."""
    return torch.randn(count, size, generator=generator, device=generator.device)
