"""The batch every method trains on."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor


@dataclass(frozen=True)
class GestureBatch:
    """A batch of windows. A field is None when no method in the run asked for it.

    Attributes:
        window_ids: ``(B,)`` int64, index of each window in its split's fixed list.
        positions: ``(B, T, 10, 3)`` float32, upper-body joints at the evaluation rate,
            root-relative, metres, house axes.
        audio: ``(B, N)`` float32, 16 kHz; ``N = round(T / fps * 16000)``.
        words: ``(B, T)`` int64, word id on its onset frame, 0 elsewhere (spec 3.7).
        speakers: ``(B,)`` int64, 1..n_speakers.
        joints: ``(B, T, J, 3)`` float32, the gesturing joints at the method's rate, relative to the
            pelvis, facing +z, metres (`cospeech.motion.gesture_joints`).
        acoustics: ``(B, T, 27)`` float32, 26 MFCC and F0 at the method's rate
            (`cospeech.speech.feature_sets.opensmile`), not normalised.
        matched: ``(B, T, J, 3)`` float32, motion found for the same speech by a search, joints as
            ``joints``.
        cepstra: ``(B, T, 28)`` float32, `cospeech.speech.feature_sets.sphinx` with slopes, not
            normalised.
        phases: ``(B, T)`` int64, gesture phases as indices into `cospeech.motion.phases.PHASES`.
    """

    window_ids: Tensor
    positions: Tensor | None = None
    audio: Tensor | None = None
    words: Tensor | None = None
    speakers: Tensor | None = None
    joints: Tensor | None = None
    acoustics: Tensor | None = None
    phases: Tensor | None = None
    matched: Tensor | None = None
    cepstra: Tensor | None = None

    def __len__(self) -> int:
        return len(self.window_ids)

    def require(self, name: str) -> Tensor:
        """The field, or an error that says how to get it.

        Raises:
            KeyError: The batch was made without the field.
        """
        value = getattr(self, name)
        if value is None:
            raise KeyError(f"the batch has no {name!r}: add it to the method's `needs`")
        return value

    def to(self, device: torch.device | str, non_blocking: bool = False) -> GestureBatch:
        """The same batch on another device."""
        moved = {
            field.name: value.to(device, non_blocking=non_blocking)
            for field in fields(self)
            if (value := getattr(self, field.name)) is not None
        }
        return replace(self, **moved)


BATCH_FIELDS = frozenset(field.name for field in fields(GestureBatch)) - {"window_ids"}
"""What a method may list in its `needs`."""
