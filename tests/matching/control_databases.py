"""Small databases of moving arms, made up for tests of controls."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from cospeech.matching.database import SpokenWords
from tests.matching.databases import make_database

ROLES = ("left_elbow", "left_wrist", "right_elbow", "right_wrist")


def arms(sequences=20, frames=64, seed=0, words=(), phases=False, recordings=None, starts_s=None):
    """Arms that wander about; ``words`` are (text, recording, start s, end s)."""
    rng = np.random.default_rng(seed)
    database = make_database(sequences, frames, seed)
    noise = rng.normal(size=(sequences, frames, len(ROLES), 3))
    poses = 0.3 * gaussian_filter1d(noise, 2.0, axis=1) + rng.normal(
        0.1, 0.1, (sequences, 1, len(ROLES), 3)
    )
    vocabulary = tuple(dict.fromkeys(text for text, *_ in words))
    values = {
        "poses": poses.astype(np.float32),
        "pose_roles": ROLES,
        "words": SpokenWords(
            vocabulary,
            np.array([vocabulary.index(text) for text, *_ in words], dtype=np.int32),
            np.array([recording for _, recording, *_ in words], dtype=np.int32),
            np.array([start for *_, start, _ in words], dtype=np.float64),
            np.array([end for *_, end in words], dtype=np.float64),
        ),
    }
    if phases:
        values["phases"] = rng.integers(-1, 9, (sequences, frames)).astype(np.int8)
    if recordings is not None:
        values["recordings"] = np.array(recordings, dtype=np.int32)
    if starts_s is not None:
        values["starts_s"] = np.array(starts_s, dtype=np.float64)
    return replace(database, **values)
