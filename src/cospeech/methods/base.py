"""What every method owes to evaluation. Training belongs to the method."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import torch
from lightning import LightningModule
from numpy.typing import NDArray
from torch import Tensor, nn

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech, Word


class Stream(ABC):
    """Motion for one speech that is heard piece by piece.

    What `push` gives and then `finish`, one after the other, is the motion of the whole speech,
    however it was cut: ``ceil(duration * fps)`` frames. A subclass implements `_hear` and `_end`.

    Attributes:
        look_ahead_s: A frame depends on no sound that is later than it by more, s; ``math.inf``
            where it depends on the whole speech.
        delay_s: After t seconds of sound the frames before ``t - delay_s`` have been put out.
    """

    def __init__(self, look_ahead_s: float, delay_s: float) -> None:
        self.look_ahead_s, self.delay_s = look_ahead_s, delay_s

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
            CospeechError: The sound holds NaN, or the method refuses it.
        """
        if not np.isfinite(samples).all():
            raise CospeechError("the waveform holds NaN or infinity", "check the audio file")
        motion = self._hear(samples, words)
        return motion if motion is not None and len(motion) else None

    @torch.no_grad()
    def finish(self) -> Motion:
        """The frames that are left up to the end of the sound; the stream is used up."""
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
        super().__init__(look_ahead_s=math.inf, delay_s=math.inf)
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


class GestureMethod(LightningModule):
    """Base of the methods: windows in, upper-body motion out.

    A subclass sets `window` and `needs`, implements `sample` and `open`, and trains itself by
    manual optimisation. Schedules are pure values of ``current_epoch``; every random number in
    training comes from torch's global generator, which the run seeds anew for each step, so that a
    resumed run continues exactly.

    Attributes:
        window: Frame rate, length, seed frames and stride of the windows it works on.
        needs: `GestureBatch` fields it reads.
        monitor: Logged value that selects the best checkpoint (lower is better).
    """

    window: WindowSpec
    needs: ClassVar[frozenset[str]]
    monitor: ClassVar[str] = "val/fgd"

    def __init__(self) -> None:
        super().__init__()
        self.automatic_optimization = False

    @abstractmethod
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item, given its real seed poses, as the paper evaluates.

        Args:
            batch: Windows with the fields of `needs`.
            generator: Source of every random draw; same seed, same motion.

        Returns:
            ``(B, T, 10, 3)`` root-relative positions of the upper-body joints, metres.
        """

    @abstractmethod
    def open(
        self,
        speaker: str | None = None,
        controls: dict[str, Any] | None = None,
        seed_motion: Motion | None = None,
        generator: torch.Generator | None = None,
    ) -> Stream:
        """Begin the motion for a speech of any length.

        Args:
            speaker: A training speaker's name; None lets the method choose.
            controls: Method-specific controls; an unknown name is an error.
            seed_motion: Upper-body motion to continue from, at the method's frame rate.
            generator: Source of every random draw; None seeds one with 0.

        Raises:
            CospeechError: The method refuses one of them.
        """

    def generate(
        self,
        speech: Speech,
        speaker: str | None = None,
        seed_motion: Motion | None = None,
        controls: dict[str, Any] | None = None,
        generator: torch.Generator | None = None,
    ) -> Motion:
        """Motion for speech of any length: all of it is pushed into a stream, which is finished.

        Args:
            speech: Waveform and, if the method reads them, words.
            speaker: As for `open`, like the other three.
            seed_motion: See `open`.
            controls: See `open`.
            generator: See `open`.

        Returns:
            Upper-body motion that covers the audio exactly: ``ceil(duration * fps)`` frames.

        Raises:
            CospeechError: As `open` and `Stream.push`.
        """
        stream = self.open(speaker, controls, seed_motion, generator)
        begun = stream.push(speech.waveform, speech.words)
        rest = stream.finish()
        return rest if begun is None else begun.followed_by(rest)

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Sampled positions of the batch, for the evaluation callback.

        The draws depend on the batch's index alone, so epochs are compared under the same noise.
        """
        generator = torch.Generator(device=self.device).manual_seed(batch_idx)
        return self.sample(batch, generator)

    def read_files(self) -> None:
        """Read the files that the settings name, before a new training and anything slow.

        A resumed training has what it needs of them in its checkpoint.

        Raises:
            CospeechError: One can't be read, or doesn't fit.
        """

    def also_judged(self, values: dict[str, Tensor]) -> dict[str, Tensor]:
        """Further values of an evaluation, logged beside those it is given.

        Args:
            values: Name, without the stage, -> value: ``fgd`` and the others of the callback.
        """
        return {}

    def test_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """As `validation_step`."""
        return self.validation_step(batch, batch_idx)


@runtime_checkable
class HasSchedule(Protocol):
    """A method whose training has an end of its own, whatever the number of epochs."""

    @property
    def steps_left(self) -> int:
        """Training steps to that end."""

    @property
    def in_last_stage(self) -> bool:
        """Whether the weights are such as the training is for, and not of a stage before."""


def refuse_unknown(
    speaker: str | None, speakers: Sequence[str], seed_motion: Motion | None
) -> None:
    """What `GestureMethod.open` refuses where a method continues no motion.

    Raises:
        CospeechError: A speaker who isn't among the training's, or a seed motion.
    """
    if speaker is not None and speaker not in speakers:
        known = ", ".join(speakers)
        raise CospeechError(f"no training speaker is called {speaker!r}; there are {known}")
    if seed_motion is not None:
        raise CospeechError("this method can't continue a motion", "leave seed_motion out")


@contextmanager
def evaluating(network: nn.Module) -> Iterator[None]:
    """The network in eval mode inside, and afterwards as it was."""
    training = network.training
    network.eval()
    try:
        yield
    finally:
        network.train(training)
