"""Motion that comes out while speech comes in."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from numbers import Real

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError, one_line
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word


class Stream(ABC):
    """Motion for one speech that is heard piece by piece.

    What `push` gives and then `finish`, one after the other, is the motion of the whole speech,
    however it was cut: ``ceil(duration * fps)`` frames, on one skeleton (`GestureMethod.generate`).
    A subclass implements `_hear` and `_end`.

    Attributes:
        look_ahead_s: A frame depends on no sound that is later than it by more, s: ``math.inf``
            where it depends on the whole speech, ``-math.inf`` where it depends on no sound.
        words_look_ahead_s: A frame depends on no word that begins later than it by more, s:
            ``math.inf`` where it depends on whole sentences or the whole speech, ``-math.inf``
            where it depends on no word.
        delay_s: After t seconds of sound the frames before ``t - delay_s`` have been put out;
            ``math.inf`` where that can't be said: they come when a sentence or the speech ends.
    """

    def __init__(
        self, look_ahead_s: float, delay_s: float, words_look_ahead_s: float = -math.inf
    ) -> None:
        self.look_ahead_s, self.delay_s = look_ahead_s, delay_s
        self.words_look_ahead_s = words_look_ahead_s
        self._is_used_up = False
        self._heard_samples = 0
        self._last_word: Word | None = None

    @torch.no_grad()
    def push(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> Motion | None:
        """Hear further sound.

        Args:
            samples: ``(N,)``, 16 kHz, what follows on the sound so far.
            words: What is said, with times in the whole speech; a word comes at the latest with
                the sound that it begins in. Those of one push may come in any order, and are
                taken in order of onset; none begins before a word of an earlier push. None: no
                transcript.

        Returns:
            The next frames; None where none can be made yet.

        Raises:
            CospeechError: The sound isn't such, holds NaN, or the method refuses it; a word isn't
                such, or came late; or the stream is used up.
        """
        if self._is_used_up:
            raise CospeechError("this stream has been finished", "open another one")
        if np.ndim(samples) != 1 or np.asarray(samples).dtype != np.float32:
            raise CospeechError(
                "samples must be (N,) float32 in [-1, 1] at 16 kHz",
                "cospeech.read_speech reads any sound file so",
            )
        if not np.isfinite(samples).all():
            raise CospeechError("the waveform holds NaN or infinity", "check the audio file")
        if words is not None:
            words = sorted(checked_words(words), key=lambda word: word.start)
            if words:
                self._check_onset(words[0])
                self._last_word = words[-1]
        self._heard_samples += len(samples)
        motion = self._hear(samples, words)
        return motion if motion is not None and len(motion) else None

    @torch.no_grad()
    def finish(self) -> Motion:
        """The frames that are left up to the end of the sound; the stream is used up.

        Raises:
            CospeechError: It is used up already.
        """
        if self._is_used_up:
            raise CospeechError("this stream has been finished", "open another one")
        self._is_used_up = True
        return self._end()

    def _check_onset(self, word: Word) -> None:
        """Refuse a word that begins in sound of earlier pushes, or before a word of theirs."""
        begins = f"the word {one_line(word.text)!r} begins at {word.start:.3f} s"
        # Times that were cut at a sample may be rounded; before all sound nothing comes late.
        if self._heard_samples and word.start * SAMPLE_RATE < self._heard_samples - 1:
            heard_s = self._heard_samples / SAMPLE_RATE
            raise CospeechError(
                f"{begins} and came after the sound it begins in: {heard_s:.3f} s of sound had"
                " been pushed before",
                "push a word with the sound that it begins in, or earlier",
            )
        last = self._last_word
        if last is not None and word.start < last.start:
            raise CospeechError(
                f"{begins}, before {one_line(last.text)!r} ({last.start:.3f} s), which was pushed"
                " earlier",
                "push words in order of onset",
            )

    @abstractmethod
    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion | None:
        """What `push` gives; no frames count as None."""

    @abstractmethod
    def _end(self) -> Motion:
        """What `finish` gives."""


class WholeUtterance(Stream):
    """The stream of a method that needs all of a speech: everything comes at `finish`.

    Args:
        make: Makes the motion.
        reads_words: Whether words have any effect.
    """

    def __init__(self, make: Callable[[Speech], Motion], reads_words: bool = True) -> None:
        super().__init__(math.inf, math.inf, math.inf if reads_words else -math.inf)
        self._make = make
        self._pieces = [np.zeros(0, dtype=np.float32)]
        self._words: list[Word] | None = None

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> None:
        self._pieces.append(samples)
        if words is not None:
            self._words = [*(self._words or ()), *words]

    def _end(self) -> Motion:
        words = None if self._words is None else tuple(self._words)
        return self._make(Speech(np.concatenate(self._pieces), words))


def checked_words(words: object) -> list[Word]:
    """Words with a text and finite times, which don't end before they begin.

    Raises:
        CospeechError: Something else was given; the message says which of them it is.
    """
    hint = (
        "a word is cospeech.speech.speech.Word(text, start, end), with times in s and start <= end"
    )
    if isinstance(words, str) or not isinstance(words, Sequence):
        raise CospeechError(f"words are a list of words, not a {type(words).__name__}", hint)
    for number, word in enumerate(words, start=1):
        if not isinstance(word, Word):
            raise CospeechError(f"word {number} of this push is a {type(word).__name__}", hint)
        if not isinstance(word.text, str):
            kind = type(word.text).__name__
            raise CospeechError(f"the text of word {number} of this push is a {kind}", hint)
        times = (word.start, word.end)
        if not all(isinstance(time, Real) and math.isfinite(time) for time in times) or (
            word.start > word.end
        ):
            raise CospeechError(
                f"word {number} of this push, {one_line(word.text)!r}, is said from {word.start!r}"
                f" to {word.end!r}",
                hint,
            )
    return list(words)


def check_speaker(speaker: str | None, speakers: Sequence[str]) -> None:
    """Refuse a speaker whom the training didn't have.

    Raises:
        CospeechError: Such a one was named.
    """
    if speaker is not None and speaker not in speakers:
        shown = ", ".join(speakers[:20]) + (" ..." if len(speakers) > 20 else "")
        raise CospeechError(
            f"no training speaker {speaker!r} among {len(speakers)}", f"choose one of: {shown}"
        )


def check_seed_motion(motion: Motion | None, window: WindowSpec) -> None:
    """Refuse a motion that a method can't continue, before anything is heard.

    Raises:
        CospeechError: The method has no seed frames, or the motion is on other joints, at another
            rate, too short, or holds NaN where it is read.
    """
    if motion is None:
        return
    if not window.seed_frames:
        raise CospeechError("this method can't continue a motion", "leave seed_motion out")
    if motion.skeleton.joints != UPPER_BODY.joints or motion.dimensions != 3:
        raise CospeechError(
            f"the seed motion is on skeleton {motion.skeleton.name!r} in {motion.dimensions}"
            " dimensions, not the upper body in 3",
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
