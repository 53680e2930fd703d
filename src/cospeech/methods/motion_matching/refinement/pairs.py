"""Pairs of windows and what was matched to them, and the folder that keeps them.

Kept are pointers into a matching database, not poses, in plain arrays::

    manifest.json   what made them, what was measured, hash
    windows.npy     (P, 2) int32: track and first frame
    ks.npy          (P,) int32: which candidate was taken, from 1
    pointers.npy    (P, S, 2) int32: sequence and first frame of every step
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError, InputFileError
from cospeech.files import made_once, write_json
from cospeech.foreign import open_array, read_json, understood

_ARRAYS = ("windows", "ks", "pointers")
_WHAT = "pairs of windows and matches"
_REBUILD = "delete the folder and make the pairs again"


@dataclass(frozen=True)
class PairSettings:
    """Which windows are searched, and how; as published by default.

    Attributes:
        frames: Frames per window.
        stride: Frames from one window's start to the next.
        k: All windows take this candidate; None: half of them take the best, the
            others one of the second to fifteenth, each as often.
        closed_frames: Sequences of a window's own recording are closed to it up to so many frames
            from its ends. None closes nothing: windows then find their own motion.
        natural_continuation: As in `match_together`.
        from_mean_pose: As in `Clip`.

    Raises:
        ConfigError: A value out of range.
    """

    frames: int = 64
    stride: int = 5
    k: int | None = None
    closed_frames: int | None = 64
    natural_continuation: bool = False
    from_mean_pose: bool = False

    def __post_init__(self) -> None:
        for name, least in (
            ("frames", 1),
            ("stride", 1),
            ("k", 1),
            ("closed_frames", 0),
        ):
            value = getattr(self, name)
            if value is not None and value < least:
                raise ConfigError(f"pairs: {name}={value}", f"use {least} or more")

    def for_judging(self, k: int = 1) -> PairSettings:
        """Windows side by side, one candidate, nothing closed: for splits not in the database."""
        return replace(self, stride=self.frames, k=k, closed_frames=None)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Windows, and what was matched to each.

    Attributes:
        settings: What made them.
        windows: ``(P, 2)`` int32: index of the track, first frame in it.
        ks: ``(P,)`` int32: which candidate was taken at every step, from 1.
        pointers: ``(P, S, 2)`` int32: sequence and first frame that each step put out.
        own_hits: Share of steps whose window lies in the closed neighbourhood when nothing is
            closed: what closing removed. None where nothing is closed.
    """

    settings: PairSettings
    windows: NDArray[np.int32]
    ks: NDArray[np.int32]
    pointers: NDArray[np.int32]
    own_hits: float | None

    def __len__(self) -> int:
        return len(self.windows)


def write_pairs(folder: Path, made_by: dict[str, Any], make: Callable[[], Pairs]) -> None:
    """Make pairs and write their folder, all of it or nothing.

    Args:
        folder: Where they go; what another process has put there meanwhile stays.
        made_by: What they depend on.
        make: Makes them.
    """
    with made_once(folder) as building:
        pairs = make()
        arrays = {name: getattr(pairs, name) for name in _ARRAYS}
        for name, values in arrays.items():
            np.save(building / f"{name}.npy", values)
        told = {"made_by": made_by, "own_hits": pairs.own_hits}
        write_json(building / "manifest.json", {**told, "hash": _content_hash(told, arrays)})


def open_pairs(folder: Path, made_by: dict[str, Any], settings: PairSettings) -> Pairs:
    """Open pairs by memory map; every byte is read and compared with the hash.

    Args:
        folder: Their folder.
        made_by: What they must have been made by.
        settings: The settings in it.

    Raises:
        InputFileError: Not what was asked for, or damaged.
    """
    path = folder / "manifest.json"
    manifest = read_json(path, _WHAT, hint=_REBUILD)
    with understood(folder, _WHAT, _REBUILD):
        if not isinstance(manifest, dict) or manifest.get("made_by") != made_by:
            raise InputFileError(path, "made by something else", hint=_REBUILD)
        arrays = {name: open_array(folder / f"{name}.npy", _WHAT, _REBUILD) for name in _ARRAYS}
        told = {name: value for name, value in manifest.items() if name != "hash"}
        if _content_hash(told, arrays) != manifest.get("hash"):
            problem = "damaged: its content isn't what was written"
            raise InputFileError(folder, problem, hint=_REBUILD)
        return Pairs(settings, **arrays, own_hits=manifest["own_hits"])


def _content_hash(manifest: dict[str, Any], arrays: dict[str, NDArray[np.int32]]) -> str:
    digest = hashlib.sha256(json.dumps(manifest, sort_keys=True).encode())
    for name in _ARRAYS:
        digest.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()
