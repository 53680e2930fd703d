"""Building a matching database from a corpus' training split."""

from __future__ import annotations

import hashlib
import json
import logging
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError, InputFileError
from cospeech.files import made_once, write_json
from cospeech.matching.database import (
    ARRAYS,
    VERSION,
    MatchingDatabase,
    content_hash,
    manifest_hash,
    open_database,
)
from cospeech.matching.features import MatchingSpec, Normalisation, stack_taps
from cospeech.matching.tracks import MatchingTracks, Track
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.speech.feature_sets.sphinx import STATIC_CHANNELS

logger = logging.getLogger(__name__)

_SEQUENCES_AT_ONCE = 256


def database_folder(store: Store, spec: MatchingSpec) -> Path:
    """Where the database of a store and a spec lies: in the store's folder."""
    settings = json.dumps([VERSION, store.fingerprint, asdict(spec)])
    name = hashlib.sha256(settings.encode()).hexdigest()[:12]
    return store.path / "matching" / name


def fit_database(store: Store, spec: MatchingSpec | None = None) -> MatchingDatabase:
    """Build the database of a corpus' training split, or open it where it was built before.

    Spans are cut into disjoint sequences, their rest is left out; nothing is read across the edge
    of a span, which would be another split's. A killed build leaves nothing behind that looks like
    a database, and a damaged one is built again.

    Args:
        store: The corpus.
        spec: How to cut it; the published lengths by default.

    Raises:
        CospeechError: No joint map fits, the skeletons have different joints, or no span is as
            long as a sequence.
        ConfigError: No training recording has sound.
    """
    spec = spec or MatchingSpec()
    folder = database_folder(store, spec)
    if folder.is_dir():
        try:
            return open_database(folder, store.fingerprint)
        except InputFileError as error:
            logger.warning("%s; it is built again", error.problem)
            shutil.rmtree(folder)
    with made_once(folder) as building:
        _Build(store, spec, building).write()
    return open_database(folder, store.fingerprint)


class _Build:
    """The arrays of one database, while they are made."""

    def __init__(self, store: Store, spec: MatchingSpec, folder: Path) -> None:
        self.store, self.spec, self.folder = store, spec, folder
        self._tracks = MatchingTracks(store, "train", spec.fps)

    def write(self) -> None:
        """Write the arrays, then the manifest."""
        spec, length = self.spec, self.spec.chunk_frames
        sequences = [(track, i) for track in self._tracks for i in _firsts(track, length)]
        if not sequences:
            raise CospeechError(
                f"{self.store.name}: no training recording is as long as a sequence"
                f" ({length / spec.fps:g} s)",
                "use longer recordings, or shorter sequences (chunk_frames)",
            )
        shape = (len(sequences), length)
        widths = {
            "pose_features": (spec.pose_taps * 3 * len(self._tracks.joints.roles),),
            "audio_features": (spec.audio_taps * STATIC_CHANNELS,),
            "poses": (len(self._tracks.pose_roles), 3),
        }
        arrays: dict[str, NDArray[Any]] = {
            name: open_memmap(self.folder / f"{name}.npy", "w+", np.float32, (*shape, *width))
            for name, width in widths.items()
        }
        arrays["usable"] = np.ones(shape, dtype=np.bool_)
        arrays["phases"] = np.stack([track.phases[i : i + length] for track, i in sequences])
        arrays["recordings"] = np.array([track.span.recording for track, _ in sequences], np.int32)
        arrays["starts_s"] = np.array([track.start_s + i / spec.fps for track, i in sequences])
        for m, (track, first) in enumerate(sequences):
            arrays["poses"][m] = track.poses[first : first + length]
            for name, channels, taps in (
                ("pose_features", track.search, spec.pose_taps),
                ("audio_features", track.audio, spec.audio_taps),
            ):
                # As published, a sequence knows nothing of what comes after it.
                ahead = spec.reach(taps) if spec.true_future else 0
                known = channels[first : first + length + ahead]
                arrays[name][m] = stack_taps(known, taps, spec.tap_spacing)[:length]
                if spec.true_future:
                    arrays["usable"][m, max(0, len(known) - spec.reach(taps)) :] = False
        recordings = self.store.recordings
        names = [recordings[track.span.recording].speaker for track, _ in sequences]
        speakers = list(dict.fromkeys(names))
        arrays["speakers"] = np.array([speakers.index(name) for name in names], np.int32)
        vocabulary, arrays["words"], arrays["word_times_s"] = self._words()
        statistics = {
            name: _normalise(arrays[f"{name}_features"], arrays["usable"])
            for name in ("pose", "audio")
        }
        learnt = {"statistics": statistics, "vocabulary": vocabulary, "speakers": speakers}
        self._finish(arrays, learnt)

    def _finish(self, arrays: dict[str, NDArray[Any]], learnt: dict[str, Any]) -> None:
        for name, values in arrays.items():
            if isinstance(values, np.memmap):
                values.flush()
            else:
                np.save(self.folder / f"{name}.npy", values)
        usable = arrays["usable"]
        manifest = {
            "version": VERSION,
            "corpus": self.store.name,
            "fingerprint": self.store.fingerprint,
            "spec": asdict(self.spec),
            **learnt,
            "search_roles": list(self._tracks.joints.roles),
            "pose_roles": list(self._tracks.pose_roles),
            "evaluation_roles": list(self._tracks.evaluation_roles),
            "unusable_frames": int((~usable).sum()),
            "arrays": {
                name: {"shape": list(arrays[name].shape), "dtype": arrays[name].dtype.name}
                for name in ARRAYS
            },
        }
        manifest["hash"] = content_hash(self.folder, manifest)
        manifest["manifest_hash"] = manifest_hash(manifest)
        write_json(self.folder / "manifest.json", manifest)
        unusable = manifest["unusable_frames"]
        logger.info(
            "matching database: %d sequences, %.1f min%s",
            len(usable),
            usable.size / self.spec.fps / 60,
            f"; no window starts on {unusable} frames, as what follows them isn't known"
            if unusable
            else "",
        )

    def _words(self) -> tuple[list[str], NDArray[np.int32], NDArray[np.float64]]:
        """Vocabulary, and of every training word its id with its recording, and its times."""
        vocabulary: dict[str, int] = {}
        ids, times = [], []
        for span in self._tracks.spans:
            offset_s = span.start / EVALUATION_FPS
            for word in self.store.speech(span).words or ():
                number = vocabulary.setdefault(word.text.lower(), len(vocabulary))
                ids.append((number, span.recording))
                times.append((offset_s + word.start, offset_s + word.end))
        return (
            list(vocabulary),
            np.array(ids, dtype=np.int32).reshape(-1, 2),
            np.array(times, dtype=np.float64).reshape(-1, 2),
        )


def _firsts(track: Track, length: int) -> range:
    """First frames of a track's disjoint sequences."""
    return range(0, len(track) - length + 1, length)


def _normalise(features: NDArray[np.float32], usable: NDArray[np.bool_]) -> list[list[float]]:
    """Normalise ``(M, T, D)`` features where they lie; their mean and deviation.

    Made-up features on which no window starts have no say in the statistics.
    """
    blocks = [
        slice(first, first + _SEQUENCES_AT_ONCE)
        for first in range(0, len(features), _SEQUENCES_AT_ONCE)
    ]
    normalisation = Normalisation.over(lambda: (features[i][usable[i]] for i in blocks))
    for rows in blocks:
        features[rows] = normalisation(features[rows])
    return [normalisation.mean.tolist(), normalisation.deviation.tolist()]
