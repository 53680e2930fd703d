"""Other motion for the same speech: what else the embedded corpus could have moved."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.corpus.synthetic.corpus import GENERATOR_VERSION, build_take
from cospeech.corpus.synthetic.takes import plan
from cospeech.errors import CospeechError
from cospeech.motion.upper_body import EVALUATION_FPS, to_upper_body
from cospeech.speech.tts import speak_all

FIRST = 1
"""What is added to a take's seed for the first motion; with nothing it would be the recorded."""


def rerolls(
    store: Store, recordings: Collection[int], count: int
) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Motions drawn anew for recordings of the embedded corpus, as the recorded one was drawn.

    Speech, speaker and habits stay; every choice of when and how to move is made again. Together
    with the recorded motion they are independent draws from the true distribution of motion, given
    the speech. The corpus is spoken again from its first line, as its voice carries state.

    Args:
        store: The embedded corpus.
        recordings: Indices of recordings.
        count: Motions of each.

    Yields:
        Recordings in their order and ``(count, T, 10, 3)`` positions in metres at 15 fps.

    Raises:
        CospeechError: It is another corpus, or of another version of the generator.
    """
    settings = store.manifest["parameters"].get("settings", {})
    if settings.get("generator") != GENERATOR_VERSION:
        raise CospeechError(
            f"{store.name}: motion can be drawn anew for the embedded corpus alone",
            "use data=synthetic",
        )
    takes = plan(settings["minutes"], settings["seed"], settings["speakers"])
    wanted = {store.recordings[index].id: index for index in recordings}
    last = max((take.index for take in takes if take.id in wanted), default=-1)
    takes = takes[: last + 1]
    utterances = speak_all(
        [(line.sentence.text, line.voice) for take in takes for line in take.lines]
    )
    for take in takes:
        spoken = list(islice(utterances, len(take.lines)))
        if take.id in wanted:
            again = (replace(take, seed=take.seed + FIRST + number) for number in range(count))
            made = [build_take(one, spoken, EVALUATION_FPS).motion for one in again]
            positions = np.stack([to_upper_body(motion).positions for motion in made])
            yield wanted[take.id], positions.astype(np.float32)
    utterances.close()
