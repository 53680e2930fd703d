"""A trained method among others that it is compared with."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.methods.base import GestureMethod


@dataclass(frozen=True, eq=False)
class TrainedSystem:
    """A trained method under a name.

    Attributes:
        name: What it is, or what was left out of it: ``"full"``, ``"no_motion"``.
        seed: Of its training; several seeds of one name are one system.
        method: The method with its weights.
    """

    name: str
    seed: int
    method: GestureMethod
