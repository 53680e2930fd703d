"""The database that motion matching searches: a corpus' training split in short sequences, on disk.

A folder of plain arrays, read by memory map::

    manifest.json        version, corpus fingerprint, settings, statistics, joints, hash
    pose_features.npy    (M, T, Dp) float32, normalised
    audio_features.npy   (M, T, Da) float32, normalised
    poses.npy            (M, T, J, 3) float32: what is put out, in the body frame, metres
    phases.npy           (M, T) int8: annotated gesture phases, -1 where there are none
    usable.npy           (M, T) bool: whether a window may start here
    speakers.npy         (M,) int32: index of the speaker in the manifest's list
    recordings.npy       (M,) int32: the recording that a sequence was cut from
    starts_s.npy         (M,) float64: time of its first frame in the recording
    words.npy            (W, 2) int32: id and recording of every word of the transcripts
    word_times_s.npy     (W, 2) float64: its onset and end in the recording
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import STATIC_CEPSTRA
from cospeech.errors import InputFileError
from cospeech.foreign import open_array, open_file, read_json, understood
from cospeech.matching.features import MatchingSpec, Normalisation, stack_taps
from cospeech.speech.feature_sets.sphinx import sphinx_frames
from cospeech.speech.speech import Speech

VERSION = 2
_PER_SEQUENCE = (
    "pose_features",
    "audio_features",
    "poses",
    "phases",
    "usable",
    "speakers",
    "recordings",
    "starts_s",
)
ARRAYS = (*_PER_SEQUENCE, "words", "word_times_s")
_HASHES = ("hash", "manifest_hash")
_DTYPES = {
    "pose_features": np.dtype(np.float32),
    "audio_features": np.dtype(np.float32),
    "poses": np.dtype(np.float32),
    "phases": np.dtype(np.int8),
    "usable": np.dtype(np.bool_),
    "speakers": np.dtype(np.int32),
    "recordings": np.dtype(np.int32),
    "starts_s": np.dtype(np.float64),
    "words": np.dtype(np.int32),
    "word_times_s": np.dtype(np.float64),
}
_WHAT = "a matching database"
MOST_MANIFEST_BYTES = 2**28
_REBUILD = "delete the folder and fit the database again"


@dataclass(frozen=True, eq=False)
class SpokenWords:
    """The transcripts of a database's recordings, W words in all.

    Attributes:
        vocabulary: Distinct words, in lower case.
        ids: ``(W,)`` indices into it.
        recordings: ``(W,)`` recordings in the store.
        starts_s: ``(W,)`` onsets in the recording, s.
        ends_s: ``(W,)`` ends, s.
    """

    vocabulary: tuple[str, ...]
    ids: NDArray[np.int32]
    recordings: NDArray[np.int32]
    starts_s: NDArray[np.float64]
    ends_s: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MatchingDatabase:
    """Sequences that windows are taken from; M of them, T frames each.

    Attributes:
        spec: How it was cut.
        pose_features: ``(M, T, Dp)`` float32, normalised.
        audio_features: ``(M, T, Da)`` float32, normalised.
        poses: ``(M, T, J, 3)`` float32, metres, in the body frame: what is put out.
        phases: ``(M, T)`` int8 indices into `cospeech.motion.phases.PHASES`, -1 where unknown.
        usable: ``(M, T)``: whether a window may start here.
        speakers: ``(M,)`` indices into ``speaker_names``.
        recordings: ``(M,)`` index of the recording in the store.
        starts_s: ``(M,)`` time of a sequence's first frame in its recording, s.
        words: What is spoken in the recordings.
        speaker_names: Who is in it.
        pose_normalisation: Of the pose features.
        audio_normalisation: Of the audio features.
        search_roles: The joints that are compared.
        pose_roles: The J joints of ``poses``.
        evaluation_roles: Those that are the ten joints of the evaluation, in its order.
        fingerprint: The corpus it comes from.
        hash: Of everything in it; a checkpoint names its database by it.
    """

    spec: MatchingSpec
    pose_features: NDArray[np.float32]
    audio_features: NDArray[np.float32]
    poses: NDArray[np.float32]
    phases: NDArray[np.int8]
    usable: NDArray[np.bool_]
    speakers: NDArray[np.int32]
    recordings: NDArray[np.int32]
    starts_s: NDArray[np.float64]
    words: SpokenWords
    speaker_names: tuple[str, ...]
    pose_normalisation: Normalisation
    audio_normalisation: Normalisation
    search_roles: tuple[str, ...]
    pose_roles: tuple[str, ...]
    evaluation_roles: tuple[str, ...]
    fingerprint: str
    hash: str

    def __len__(self) -> int:
        return len(self.usable)

    def spoken_by(self, speaker: str) -> NDArray[np.bool_]:
        """``(M,)``: the sequences of one speaker; none of somebody who isn't in it."""
        return np.array([name == speaker for name in self.speaker_names])[self.speakers]

    def upper_body(self, poses: NDArray[np.float32]) -> NDArray[np.float32]:
        """The evaluation's ``(..., 10, 3)`` of poses ``(..., J, 3)``; the spine is the origin."""
        chosen = poses[..., [self.pose_roles.index(role) for role in self.evaluation_roles], :]
        relative: NDArray[np.float32] = chosen - chosen[..., :1, :]
        return relative

    def of_others(self, speaker: str | None, generator: torch.Generator) -> NDArray[np.int64]:
        """The sequences that aren't of a speaker; somebody is drawn where it has none of theirs."""
        if speaker is None or speaker not in self.speaker_names:
            drawn = int(torch.randint(len(self.speaker_names), (), generator=generator))
            speaker = self.speaker_names[drawn]
        return np.flatnonzero(~self.spoken_by(speaker))

    def audio_queries(
        self, waveform: NDArray[np.float32], frames: int | None = None
    ) -> NDArray[np.float32]:
        """Normalised audio features of speech to gesture to.

        Past the end there are zeros before normalisation, as published; with
        ``spec.true_future`` the last frame stays, as zeros are like no speech in the database.

        Args:
            waveform: ``(N,)`` samples at 16 kHz.
            frames: F; those that begin past the waveform's end are silent. None: as many as
                there are whole frames.

        Returns:
            ``(F, Da)`` at ``spec.fps``.
        """
        fps = self.spec.fps
        count = sphinx_frames(len(waveform), fps) if frames is None else frames
        return self.queries_of(STATIC_CEPSTRA.of_speech(Speech(waveform), fps, count))

    def queries_of(self, channels: NDArray[np.float32]) -> NDArray[np.float32]:
        """As `audio_queries`, of the ``(F, 14)`` channels of speech up to its end."""
        spec = self.spec
        count, reach = len(channels), spec.reach(spec.audio_taps)
        if spec.true_future and count:
            channels = np.pad(channels, ((0, reach), (0, 0)), mode="edge")
        features = stack_taps(channels, spec.audio_taps, spec.tap_spacing)[:count]
        return self.audio_normalisation(features)


def open_database(folder: Path | str, fingerprint: str | None = None) -> MatchingDatabase:
    """Open a database by memory map.

    Args:
        folder: Its folder.
        fingerprint: The corpus that it must come from; None for any.

    Raises:
        InputFileError: Not a database, of another version or corpus, or damaged.
    """
    folder = Path(folder)
    path = folder / "manifest.json"
    if not path.is_file():
        hint = "build it with fit_database(store)"
        raise InputFileError(folder, "no matching database here", hint=hint)
    manifest = read_json(path, _WHAT, MOST_MANIFEST_BYTES, _REBUILD)
    if not isinstance(manifest, dict) or manifest.get("version") != VERSION:
        version = manifest.get("version") if isinstance(manifest, dict) else None
        problem = f"version {version!r:.40}, this version reads {VERSION}"
        raise InputFileError(path, problem, hint=_REBUILD)
    if fingerprint is not None and manifest.get("fingerprint") != fingerprint:
        raise InputFileError(
            path,
            f"made from corpus {str(manifest.get('fingerprint'))[:12]}, not {fingerprint[:12]}",
            hint="open the database of this corpus: fit_database(store)",
        )
    with understood(path, _WHAT, _REBUILD):
        if manifest.get("manifest_hash") not in (None, manifest_hash(manifest)):
            raise InputFileError(path, "damaged: it isn't what was written", hint=_REBUILD)
        return _described(folder, manifest)


def _described(folder: Path, manifest: dict[str, Any]) -> MatchingDatabase:
    statistics = {
        name: Normalisation(*(np.array(values, np.float64) for values in both))
        for name, both in manifest["statistics"].items()
    }
    arrays = {name: _open_array(folder, name, manifest["arrays"][name]) for name in ARRAYS}
    spec = MatchingSpec(**manifest["spec"])
    for name in ("vocabulary", "speakers", "search_roles", "pose_roles", "evaluation_roles"):
        if not all(isinstance(value, str) for value in manifest[name]):
            raise ValueError(f"{name} is no list of names")
    for name in ("fingerprint", "hash"):
        if not isinstance(manifest[name], str):
            raise ValueError(f"{name} is no text")
    _require_consistent(spec, arrays, statistics, manifest)
    words, times_s = arrays["words"], arrays["word_times_s"]
    return MatchingDatabase(
        spec,
        **{name: arrays[name] for name in _PER_SEQUENCE},
        words=SpokenWords(
            tuple(manifest["vocabulary"]), words[:, 0], words[:, 1], times_s[:, 0], times_s[:, 1]
        ),
        speaker_names=tuple(manifest["speakers"]),
        pose_normalisation=statistics["pose"],
        audio_normalisation=statistics["audio"],
        search_roles=tuple(manifest["search_roles"]),
        pose_roles=tuple(manifest["pose_roles"]),
        evaluation_roles=tuple(manifest["evaluation_roles"]),
        fingerprint=manifest["fingerprint"],
        hash=manifest["hash"],
    )


def _require_consistent(
    spec: MatchingSpec,
    arrays: dict[str, NDArray[Any]],
    statistics: dict[str, Normalisation],
    manifest: dict[str, Any],
) -> None:
    """Compare the shapes with one another, and indices with what they are into.

    Raises:
        ValueError: They disagree.
    """
    sequences, words = len(arrays["usable"]), len(arrays["words"])
    frames = (sequences, spec.chunk_frames)
    shapes: dict[str, tuple[int, ...]] = {
        "pose_features": (*frames, *statistics["pose"].mean.shape),
        "audio_features": (*frames, *statistics["audio"].mean.shape),
        "poses": (*frames, len(manifest["pose_roles"]), 3),
        "phases": frames,
        "usable": frames,
        "speakers": (sequences,),
        "recordings": (sequences,),
        "starts_s": (sequences,),
        "words": (words, 2),
        "word_times_s": (words, 2),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape or arrays[name].dtype != _DTYPES[name]:
            found = f"{arrays[name].dtype} {arrays[name].shape}"
            raise ValueError(f"{name} holds {found}, not {_DTYPES[name]} {shape}")
    for name, one in statistics.items():
        if one.mean.ndim != 1 or one.mean.shape != one.deviation.shape:
            raise ValueError(f"the statistics of {name} are of different sizes")
    for indices, names in (
        (arrays["speakers"], manifest["speakers"]),
        (arrays["words"][:, 0], manifest["vocabulary"]),
    ):
        if len(indices) and not 0 <= indices.min() <= indices.max() < len(names):
            raise ValueError("an index is past the end of its list")


def check_database(folder: Path | str) -> None:
    """Read every byte of a database and compare its hash: seconds for a large one.

    Raises:
        InputFileError: It can't be opened, or isn't what was written.
    """
    folder = Path(folder)
    database = open_database(folder)
    path = folder / "manifest.json"
    manifest = read_json(path, _WHAT, MOST_MANIFEST_BYTES, _REBUILD)
    with understood(folder, _WHAT, _REBUILD):
        if content_hash(folder, manifest) != database.hash:
            raise InputFileError(folder, "its content isn't what was written", hint=_REBUILD)


def _open_array(folder: Path, name: str, facts: dict[str, Any]) -> NDArray[Any]:
    path = folder / f"{name}.npy"
    with understood(path, "an array of a matching database", _REBUILD):
        values = open_array(path, "an array of a matching database", _REBUILD)
        if list(values.shape) != facts["shape"] or values.dtype.name != facts["dtype"]:
            found = f"{values.dtype.name} {list(values.shape)}"
            problem = f"holds {found} where the manifest says {facts['dtype']} {facts['shape']}"
            raise InputFileError(path, problem, hint=_REBUILD)
    return values


def manifest_hash(manifest: dict[str, Any]) -> str:
    """SHA-256 of what the manifest says, as `open_database` compares it: at once."""
    told = {name: value for name, value in manifest.items() if name != "manifest_hash"}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def content_hash(folder: Path, manifest: dict[str, Any]) -> str:
    """SHA-256 of the arrays and of what the manifest says of them."""
    told = {name: value for name, value in manifest.items() if name not in _HASHES}
    digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
    for name in ARRAYS:
        with open_file(folder / f"{name}.npy") as file:
            while block := file.read(2**20):
                digest.update(block)
    return digest.hexdigest()
