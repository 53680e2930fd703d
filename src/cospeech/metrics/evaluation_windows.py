"""Motion as windows of the evaluation space: what every metric compares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import (
    EVALUATION_FPS,
    EVALUATION_FRAMES,
    EVALUATION_STRIDE,
    to_upper_body,
)


@dataclass(frozen=True, eq=False)
class EvaluationWindows:
    """n windows of the evaluation space, with what was said meanwhile.

    Attributes:
        positions: ``(n, 34, 10, 3)`` root-relative positions, house axes, metres.
        features: ``(n, 32)`` of the frozen encoder.
        fields: The corpus's fields that the metrics of an evaluation declare, by their names in
            `cospeech.corpus.features`, over the same time: ``(n, 34, ...)`` at the evaluation's
            frames, sound ``(n, 36267)`` at 16 kHz, and ``(n, ...)`` what is one for the window. Of
            generated motion they are those of the speech that it was generated for.
    """

    positions: Tensor
    features: Tensor
    fields: Mapping[str, Tensor] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, index: Tensor) -> EvaluationWindows:
        """Some of the windows, by a mask or by indices."""
        fields = {name: values[index] for name, values in self.fields.items()}
        return EvaluationWindows(self.positions[index], self.features[index], fields)

    def moving(self, positions: Tensor, features: Tensor) -> EvaluationWindows:
        """Other motion for the same speech."""
        return EvaluationWindows(positions, features, self.fields)

    def as_if_of(self, other: EvaluationWindows) -> EvaluationWindows:
        """The same motion, for other speech."""
        return other.moving(self.positions, self.features)


def to_evaluation_windows(motion: Motion) -> Tensor:
    """Cut a motion into windows of the evaluation space.

    Args:
        motion: On any skeleton that has the upper-body joints (`to_upper_body`), at any frame rate.

    Returns:
        ``(n, 34, 10, 3)`` float32 at 15 fps, window i from frame 10 i on; frames after the last
        full window are left out, and a motion shorter than one window gives none.

    Raises:
        CospeechError: The skeleton has no such joints.
    """
    upper_body = to_upper_body(motion).positions
    positions = torch.from_numpy(resample_positions(upper_body, motion.fps, EVALUATION_FPS))
    return cut_windows(positions[None])


def cut_windows(values: Tensor) -> Tensor:
    """Cut values at the evaluation rate into windows of the evaluation space.

    Args:
        values: ``(B, T, ...)`` at 15 fps: positions ``(B, T, 10, 3)``, or any other field.

    Returns:
        ``(B n, 34, ...)``; of each item the n windows that begin every ten frames.
    """
    if values.shape[1] < EVALUATION_FRAMES:
        return values.new_empty(0, EVALUATION_FRAMES, *values.shape[2:])
    windows = values.unfold(1, EVALUATION_FRAMES, EVALUATION_STRIDE)
    return windows.movedim(-1, 2).flatten(0, 1)
