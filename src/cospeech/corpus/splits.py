"""Which part of which recording trains, validates and tests."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.errors import ConfigError

logger = logging.getLogger(__name__)

SPLITS = ("train", "val", "test")


@dataclass(frozen=True)
class Span:
    """A stretch of one recording that belongs to one split.

    Attributes:
        recording: Index of the recording in the store.
        start: First evaluation-rate frame.
        stop: Frame after the last.
    """

    recording: int
    start: int
    stop: int


def in_groups(spans: Iterable[Span], frames: int) -> Iterator[list[Span]]:
    """Spans in order, in groups of at least so many frames, but the last."""
    group: list[Span] = []
    count = 0
    for span in spans:
        group.append(span)
        count += span.stop - span.start
        if count >= frames:
            yield group
            group, count = [], 0
    if group:
        yield group


def published_spans(
    ids: Sequence[str], names: Sequence[str | None], frames: Sequence[int]
) -> dict[str, list[Span]]:
    """Whole recordings in the splits that their corpus publishes.

    A corpus whose test part is kept back is judged on its validation part, with a warning.

    Args:
        ids: Recording ids.
        names: Split of each recording, None where the corpus says nothing.
        frames: Evaluation-rate frames of each recording.

    Raises:
        ConfigError: A recording has no published split, or no recording trains or validates.
    """
    lost = [i for i, name in zip(ids, names, strict=True) if name not in SPLITS]
    if lost:
        raise ConfigError(
            f"{len(lost)} of {len(ids)} recordings have no published split, e.g. {lost[0]}",
            "split them here: data.split=recordings, speakers or time_blocks",
        )
    spans = {
        split: [Span(i, 0, frames[i]) for i, name in enumerate(names) if name == split]
        for split in SPLITS
    }
    for split in ("train", "val"):
        if not spans[split]:
            raise ConfigError(
                f"the published split has no {split} recording among those that could be read",
                "get that part of the corpus, mend what was skipped, or split what is there:"
                " data.split=recordings, or time_blocks for a handful of takes",
            )
    if not spans["test"]:
        logger.warning("no test recording here: what is called test below is the validation split")
        spans["test"] = list(spans["val"])
    return spans


def split_recordings(
    speakers: Sequence[str],
    val_share: float,
    test_share: float,
    seed: int,
    held_out: str = "recordings",
) -> list[str]:
    """A split name per recording; whole recordings only, as the TED set splits by video.

    Args:
        speakers: Speaker of each recording.
        val_share: Share of recordings for validation.
        test_share: Share for testing.
        seed: Seed of the shuffle.
        held_out: ``"recordings"``: held-out recordings are of speakers that also train, so long as
            a speaker has a recording to spare. ``"speakers"``: held-out recordings are of speakers
            that never train.

    Raises:
        ConfigError: Too few recordings or speakers for three splits, or impossible shares.
    """
    rng = np.random.default_rng(seed)
    if held_out == "speakers":
        names = sorted(set(speakers))
        counts = _share_counts(len(names), val_share, test_share, "speakers")
        order = [names[i] for i in rng.permutation(len(names))]
        split_of = {name: split for name, split in zip(order, counts, strict=True)}
        return [split_of[speaker] for speaker in speakers]
    if held_out != "recordings":
        raise ConfigError(f"held_out is 'recordings' or 'speakers', not {held_out!r}")
    labels = _share_counts(len(speakers), val_share, test_share, "recordings")
    wanted = [label for label in labels if label != "train"]
    remaining = Counter(speakers)
    result = ["train"] * len(speakers)
    order_of_choice = [int(i) for i in rng.permutation(len(speakers))]
    # Speakers with recordings to spare give first; a lone recording is taken when none is left.
    order_of_choice.sort(key=lambda i: remaining[speakers[i]] < 2)
    for fewest in (2, 0):
        for i in order_of_choice:
            if wanted and result[i] == "train" and remaining[speakers[i]] >= fewest:
                result[i] = wanted.pop()
                remaining[speakers[i]] -= 1
    return result


def _share_counts(count: int, val_share: float, test_share: float, what: str) -> list[str]:
    if not (val_share >= 0 and test_share >= 0 and val_share + test_share < 1):
        raise ConfigError(
            f"data.val_share={val_share:g} and data.test_share={test_share:g} leave nothing to"
            " train on",
            "give shares of 0 to 1 whose sum is below 1",
        )
    val, test = max(1, round(count * val_share)), max(1, round(count * test_share))
    if count - val - test < 1:
        raise ConfigError(
            f"{count} {what} can't be split into train, validation and test",
            "give the corpus more, or cut recordings into time blocks with data.split=time_blocks",
        )
    return ["val"] * val + ["test"] * test + ["train"] * (count - val - test)


def time_blocks(
    frames: Sequence[int], val_share: float, test_share: float, minimum: int
) -> dict[str, list[Span]]:
    """Each recording cut in time: its first part trains, then validation, then test.

    For a handful of long takes. Blocks of one recording share speaker and session, so numbers from
    such a split say how well a take is continued, not how well a new one is met.

    Args:
        frames: Evaluation-rate frames of each recording.
        val_share: Share of each recording for validation.
        test_share: Share for testing.
        minimum: Fewest frames a block needs to be judged; shares are raised to it, and a recording
            too short to give as much to each split trains whole.
    """
    spans: dict[str, list[Span]] = {name: [] for name in SPLITS}
    for i, count in enumerate(frames):
        val = max(round(count * val_share), minimum)
        test = max(round(count * test_share), minimum)
        train = count - val - test
        if train < minimum:
            spans["train"].append(Span(i, 0, count))
            continue
        spans["train"].append(Span(i, 0, train))
        spans["val"].append(Span(i, train, train + val))
        spans["test"].append(Span(i, train + val, count))
    if not spans["val"]:
        raise ConfigError(
            f"no recording is long enough for time blocks of {minimum} frames",
            "add recordings, or raise data.val_share and data.test_share",
        )
    return spans
