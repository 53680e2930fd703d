"""A finished run among those that a study compares."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.methods.base import GestureMethod


@dataclass(frozen=True, eq=False)
class TrainedSystem:
    """A trained method under the name of what was left out.

    Attributes:
        name: ``"full"`` or e.g. ``"no_motion"``.
        seed: Of its training; several seeds of one name are one system.
        method: With its weights.
    """

    name: str
    seed: int
    method: GestureMethod
