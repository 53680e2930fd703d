"""Motion that comes out while speech comes in."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech, Word


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

    @torch.no_grad()
    def push(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> Motion | None:
        """Hear further sound.

        Args:
            samples: ``(N,)``, 16 kHz, what follows on the sound so far.
            words: What is said, with times in the whole speech; a word comes at the latest with
                the sound that it begins in. None: no transcript.

        Returns:
            The next frames; None where none can be made yet.

        Raises:
            CospeechError: The sound isn't such, holds NaN, or the method refuses it; or the stream
                is used up.
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
    """

    def __init__(self, make: Callable[[Speech], Motion]) -> None:
        super().__init__(look_ahead_s=math.inf, delay_s=math.inf, words_look_ahead_s=math.inf)
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
