"""Who speaks in each window."""

from __future__ import annotations

import numpy as np

from cospeech.corpus.features.field import Gather, Places, WindowField
from cospeech.corpus.store import Store


def _reader(store: Store, places: Places) -> Gather:
    ids = store.speaker_ids
    of_recording = [ids.get(name, 0) for name in store.recordings.columns["speaker"]]
    speakers = np.array(of_recording, dtype=np.int64)[places.recordings]
    return lambda windows: speakers[windows]


SPEAKERS = WindowField(
    name="speakers",
    reads="speaker",
    axis="none",
    unit="1 to the number of training speakers, 0 for anybody else",
    dtype=np.int64,
    reader=_reader,
)
