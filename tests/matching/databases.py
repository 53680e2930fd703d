"""Small databases made up for tests."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from cospeech.matching.database import MatchingDatabase, SpokenWords
from cospeech.matching.features import MatchingSpec, Normalisation

NO_WORDS = SpokenWords((), *np.zeros((2, 0), dtype=np.int32), *np.zeros((2, 0)))


def make_database(sequences=20, frames=64, seed=0, pose_size=96, audio_size=112):
    """Smooth pose features, rough audio features; pose j of frame f of sequence m is (m, f, j)."""
    rng = np.random.default_rng(seed)
    shape = (sequences, frames)
    pose = 4 * gaussian_filter1d(rng.normal(size=(*shape, pose_size)), 3.0, axis=1)
    numbers = np.stack(np.broadcast_arrays(*np.ogrid[:sequences, :frames, :2]), axis=-1)
    return from_features(pose, rng.normal(size=(*shape, audio_size)), numbers)


def from_features(pose, audio, poses=None):
    shape = pose.shape[:2]
    if poses is None:
        poses = np.zeros((*shape, 2, 3))
    unit = [
        Normalisation(np.zeros(size), np.ones(size)) for size in (pose.shape[2], audio.shape[2])
    ]
    return MatchingDatabase(
        MatchingSpec(chunk_frames=shape[1]),
        pose.astype(np.float32),
        audio.astype(np.float32),
        poses.astype(np.float32),
        np.full(shape, -1, dtype=np.int8),
        np.ones(shape, dtype=bool),
        np.zeros(shape[0], dtype=np.int32),
        np.zeros(shape[0], dtype=np.int32),
        np.arange(shape[0]) * shape[1] / 15,
        NO_WORDS,
        ("ada",),
        *unit,
        ("a", "b"),
        ("a", "b"),
        ("a",),
        "0" * 64,
        "1" * 64,
    )
