"""The batch every method trains on."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from cospeech.corpus.features import FIELDS


@dataclass(init=False, eq=False)  # Lightning looks into dataclasses for the size of a batch
class GestureBatch:
    """A batch of windows, with the fields that a method asked for (`cospeech.corpus.features`).

    There are three time axes, of different lengths for the same time, and a field of the catalogue
    names its own: T frames at the method's rate; E frames at the evaluation's 15 fps; N samples at
    16 kHz. Fields of speech have ``past + T + ahead`` frames where the method's windows ask for
    context.

    * ``positions`` ``(B, E, 10, 3)``: upper-body joints, root-relative, metres, house axes.
    * ``audio`` ``(B, N)``: ``N = round(T / fps * 16000)``.
    * ``words`` ``(B, T)`` int64: word id on its onset frame, 0 elsewhere (docs/facts/trimodal.md,
      section 3.7).
    * ``word_vectors`` ``(B, T, C)``: of the word that is being said, zeros between words.
    * ``speakers`` ``(B,)`` int64: 1..n_speakers, 0 for anybody else.
    * ``joints`` ``(B, T, J, 3)``: the gesturing joints, relative to the pelvis, facing +z, metres
      (`cospeech.motion.gesture_joints`); ``poses`` are these, nose and head; ``wrists`` the left
      and the right one relative to the spine.
    * ``rotations`` ``(B, T, J, 4)``: each joint relative to its parent, unit quaternions (x, y, z,
      w) in the order of the recorded skeleton; ``root`` ``(B, T, 3)`` where its first joint is.
    * ``matched`` ``(B, T, J, 3)``: motion found for the same speech by a search, as ``poses``.
    * ``phases`` ``(B, T)`` int64: gesture phases as indices into `cospeech.motion.phases.PHASES`.
    * ``acoustics`` ``(B, T, 27)``, ``cepstra`` ``(B, T, 28)`` and every other feature of speech
      ``(B, T, C)``, not normalised.

    Args:
        window_ids: ``(B,)`` int64, index of each window in its split's fixed list.
        fields: Name -> values, float32 where nothing else is said.

    Attributes:
        window_ids: As given.
        fields: Those that aren't None.
    """

    window_ids: Tensor
    fields: dict[str, Tensor]

    def __init__(self, window_ids: Tensor, **fields: Tensor | None) -> None:
        # Or `dataclasses.replace` would put all fields into one that is called "fields".
        if unknown := fields.keys() - FIELDS.keys():
            raise AttributeError(f"no batch field {', '.join(unknown)}; see GestureBatch.having")
        self.window_ids = window_ids
        self.fields = {name: value for name, value in fields.items() if value is not None}

    def __len__(self) -> int:
        return len(self.window_ids)

    def __getattr__(self, name: str) -> Tensor | None:
        """A field by its name; None where the batch was made without it."""
        if name not in FIELDS:
            raise AttributeError(f"no batch field {name}; there are {', '.join(FIELDS)}")
        return self.fields.get(name)

    def require(self, name: str) -> Tensor:
        """The field, or an error that says how to get it.

        Raises:
            KeyError: The batch was made without the field.
        """
        if name not in self.fields:
            declared = ", ".join(sorted(self.fields)) or "none"
            raise KeyError(
                f"the batch has no {name!r}: the method's `needs` declare {declared}; add it there"
            )
        return self.fields[name]

    def having(self, **fields: Tensor) -> GestureBatch:
        """The same batch with more fields, or others in the place of those it has."""
        return GestureBatch(self.window_ids, **{**self.fields, **fields})

    def to(self, device: torch.device | str, non_blocking: bool = False) -> GestureBatch:
        """The same batch on another device."""
        moved = {
            name: value.to(device, non_blocking=non_blocking) for name, value in self.fields.items()
        }
        return GestureBatch(self.window_ids.to(device, non_blocking=non_blocking), **moved)
