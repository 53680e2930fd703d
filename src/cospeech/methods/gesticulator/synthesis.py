"""Motion for speech of any length, pose by pose (Kucherenko et al. 2020, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.features.streaming import RowStream
from cospeech.methods.gesticulator.networks import AHEAD, FRAME_SIZES, PAST, GesticulatorNetwork
from cospeech.methods.streams import Stream
from cospeech.motion.motion import Motion
from cospeech.nn.modes import evaluating
from cospeech.speech.speech import Word


class PoseByPose(Stream):
    """Poses as soon as the speech around them is known.

    Before and after the speech there is silence. Every frame of speech is encoded once. Frames go
    through the network one by one, so that a pose is the same to the bit however the sound is cut;
    of all frames at once it differs by rounding.

    With text from a language model a frame waits for the end of the sentences that it looks at,
    however long they are: ``delay_s`` is infinite, though frames come before the speech ends.

    Args:
        network: The network.
        inputs: The fields of speech that it reads, side by side.
        silence: ``(speech_size,)`` what they are where nobody speaks.
        history: ``(1, 3, pose_size)`` poses before the first, the last one first.
        to_motion: What is put out of poses ``(T, pose_size)``.
        fps: Frames per second.
    """

    def __init__(
        self,
        network: GesticulatorNetwork,
        inputs: Sequence[RowStream],
        silence: Tensor,
        history: Tensor,
        to_motion: Callable[[Tensor], Motion],
        fps: float,
    ) -> None:
        ahead_s = AHEAD / fps
        super().__init__(
            look_ahead_s=ahead_s + max(rows.look_ahead_s for rows in inputs),
            delay_s=ahead_s + max(rows.delay_s for rows in inputs),
            words_look_ahead_s=ahead_s + max(rows.words_look_ahead_s for rows in inputs),
        )
        self._network, self._inputs, self._to_motion = network, inputs, to_motion
        self._silence, self._history = silence, history
        nothing = np.zeros(0, dtype=np.float32)
        self._waiting = [rows.hear(nothing) for rows in inputs]
        with torch.no_grad(), evaluating(network):
            self._encoded = self._encode(silence.expand(PAST, -1))

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion | None:
        speech = self._joined([rows.hear(samples, words) for rows in self._inputs])
        return self._to_motion(self._poses(speech)) if len(speech) else None

    def _end(self) -> Motion:
        speech = self._joined([rows.finish() for rows in self._inputs])
        return self._to_motion(self._poses(torch.cat([speech, self._silence.expand(AHEAD, -1)])))

    def _joined(self, rows: Sequence[NDArray[np.float32]]) -> Tensor:
        """``(F, speech_size)``: the next frames of which every field is known."""
        waiting = [np.concatenate(pair) for pair in zip(self._waiting, rows, strict=True)]
        known = min(map(len, waiting))
        self._waiting = [values[known:] for values in waiting]
        joined = np.concatenate([values[:known] for values in waiting], axis=1)
        return torch.from_numpy(joined).to(self._silence.device)

    def _poses(self, speech: Tensor) -> Tensor:
        """``(T, pose_size)`` the poses that further frames of speech complete."""
        with evaluating(self._network):
            self._encoded = torch.cat([self._encoded, self._encode(speech)])
            span = PAST + 1 + AHEAD
            poses = [self._silence.new_zeros(0, self._network.pose_size)]
            for first in range(len(self._encoded) - span + 1):
                window = self._encoded[first : first + span]
                (said,) = self._network.encode_windows(window[None, None])
                pose = self._network.pose(said, self._history)
                self._history = torch.cat([pose[:, None], self._history[:, :-1]], dim=1)
                poses.append(pose)
        self._encoded = self._encoded[len(poses) - 1 :]
        return torch.cat(poses)

    def _encode(self, speech: Tensor) -> Tensor:
        """``(F, 124)`` of frames of speech."""
        frames = [self._network.encode_frame(frame) for frame in speech.split(1)]
        return torch.cat(frames) if frames else speech.new_zeros(0, FRAME_SIZES[-1])
