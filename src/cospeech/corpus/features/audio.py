"""The sound of each window as it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Gather, Places, WindowField
from cospeech.corpus.store import Store
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.speech.speech import SAMPLE_RATE


def _reader(store: Store, places: Places) -> Gather:
    recordings, samples, length = places.recordings, places.samples, places.audio_samples
    first_rows = store.first_rows["audio"][recordings] + samples
    ends = np.rint(places.stops / EVALUATION_FPS * SAMPLE_RATE).astype(np.int64)
    ends[places.stops >= np.array(store.recordings.columns["frames"])[recordings]] = 2**62
    beyond = samples + length - ends

    def gather(windows: NDArray[np.int64]) -> NDArray[np.float32]:
        audio = np.empty((len(windows), length), dtype=np.float32)
        store.will_read("audio", first_rows[windows], length)
        for row, window in zip(audio, windows, strict=True):
            store.copy_audio(int(recordings[window]), int(samples[window]), row)
            # Past its span a window hears what it has heard, backwards, as past a recording's end.
            if (over := int(beyond[window])) > 0:
                row[-over:] = np.pad(row[:-over], (0, over), mode="symmetric")[-over:]
        return audio

    return gather


AUDIO = WindowField(
    name="audio", reads="sound", axis="samples", unit="1 is full scale", reader=_reader
)
