"""Other motion for the same speech: what else the embedded corpus could have moved."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.corpus.synthetic.corpus import GENERATOR_VERSION, build_take
from cospeech.corpus.synthetic.takes import TakePlan, plan
from cospeech.errors import CospeechError
from cospeech.motion.upper_body import EVALUATION_FPS, to_upper_body
from cospeech.speech.tts import Utterance, speak_all

_SAME_M = 1e-4
"""Recorded motion that is made again is the same to the bit; another voice moves it centimetres."""

_MOST_SPEAKERS = 10_000
"""A store may be anybody's; a plan takes memory by what it says."""


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
        CospeechError: It is another corpus, of another version of the generator, or the voice of
            this machine speaks it otherwise.
    """
    wanted = {store.recordings[index].id: index for index in recordings}
    takes = _takes(store)
    last = max((take.index for take in takes if take.id in wanted), default=-1)
    takes = takes[: last + 1]
    utterances = speak_all(
        [(line.sentence.text, line.voice) for take in takes for line in take.lines]
    )
    with closing(utterances):
        for take in takes:
            spoken = list(islice(utterances, len(take.lines)))
            if take.id in wanted:
                index = wanted[take.id]
                _require_same(_positions(take, spoken), store.upper_body(index), take.id)
                again = (replace(take, seed=take.seed + 1 + number) for number in range(count))
                yield index, np.stack([_positions(one, spoken) for one in again])


def _takes(store: Store) -> list[TakePlan]:
    """The takes that the corpus was planned as, of which the store may have left some out."""
    settings = store.manifest["parameters"].get("settings")
    known: dict[str, type | tuple[type, ...]]
    known = {"generator": str, "minutes": (int, float), "seed": int, "speakers": int}
    recorded_minutes = sum(store.recordings.columns["frames"]) / EVALUATION_FPS / 60
    if (
        not isinstance(settings, dict)
        or not all(isinstance(settings.get(name), kind) for name, kind in known.items())
        or settings["generator"] != GENERATOR_VERSION
        or not 0 < settings["minutes"] <= 2 * recorded_minutes
        or not 0 < settings["speakers"] <= _MOST_SPEAKERS
    ):
        raise CospeechError(
            f"{store.name}: motion can be drawn anew for the embedded corpus alone",
            "use data=synthetic",
        )
    return plan(settings["minutes"], settings["seed"], settings["speakers"])


def _positions(take: TakePlan, spoken: list[Utterance]) -> NDArray[np.float32]:
    return to_upper_body(build_take(take, spoken, EVALUATION_FPS).motion).positions


def _require_same(made: NDArray[np.float32], recorded: NDArray[np.float32], take_id: str) -> None:
    if made.shape != recorded.shape or np.abs(made - recorded).max() > _SAME_M:
        raise CospeechError(
            f"{take_id}: the voice here doesn't speak it as it was spoken, so its motion can't be"
            " drawn anew",
            "prepare the corpus again on this machine: python prepare.py data=synthetic"
            " data.store_dir=DIR",
        )
