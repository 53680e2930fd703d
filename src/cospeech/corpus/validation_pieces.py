"""The multi-adversary paper's validation: random short pieces of the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import ConfigError
from cospeech.motion.upper_body import EVALUATION_FPS

PIECES, PIECE_S = 13, 30.0
"""Ferstl et al. 2020, section 4: 6.5 minutes in all."""


@dataclass(frozen=True)
class Pieces:
    """Which pieces validate.

    Attributes:
        count: Number of pieces.
        piece_s: Length of each, s.
        seed: Of their places.
    """

    count: int = PIECES
    piece_s: float = PIECE_S
    seed: int = 0


def spans_by_pieces(store: Store, split: str, pieces: Pieces, with_sound: bool) -> list[Span]:
    """What trains (``split="train"``) or validates of the annotated training and validation spans.

    Raises:
        ConfigError: The corpus is too short for the pieces.
    """
    columns = store.recordings.columns
    usable = [
        span
        for span in (*store.splits["train"], *store.splits["val"])
        if columns["has_phases"][span.recording]
        and (columns["has_audio"][span.recording] or not with_sound)
    ]
    parts = validation_pieces(sorted(usable, key=_place), pieces.seed, pieces.count, pieces.piece_s)
    return parts[0] if split == "train" else parts[1]


def validation_pieces(
    spans: Sequence[Span], seed: int, count: int = PIECES, piece_s: float = PIECE_S
) -> tuple[list[Span], list[Span]]:
    """Random pieces that don't overlap, and what is left around them.

    Every place where a piece fits is equally likely for the next one. The rest is cut at the
    pieces, so no window of it touches one, in whatever interleave.

    Args:
        spans: What may be used.
        seed: Of the places.
        count: Number of pieces.
        piece_s: Length of each, s.

    Returns:
        (training spans, pieces), in order of recording and time.

    Raises:
        ConfigError: The pieces would take more than half of it, or no stretch is long enough for
            the next one.
    """
    frames = round(piece_s * EVALUATION_FPS)
    total = sum(span.stop - span.start for span in spans)
    generator = np.random.default_rng(seed)
    rest, pieces = list(spans), list[Span]()
    while len(pieces) < count:
        room = np.array([max(0, span.stop - span.start - frames + 1) for span in rest])
        if 2 * count * frames > total or not room.sum():
            raise ConfigError(
                f"{count} pieces of {piece_s:g} s don't fit into {len(spans)} recordings of"
                f" {total / EVALUATION_FPS / 60:.1f} min in all and leave half for training",
                "use a longer corpus or smaller pieces (model.pieces, model.piece_s), or leave"
                " recordings out (model.protocol=split)",
            )
        place = int(generator.integers(room.sum()))
        index = int(np.searchsorted(np.cumsum(room), place, side="right"))
        recording, first, last = rest[index].recording, rest[index].start, rest[index].stop
        start = first + place - int(room[:index].sum())
        pieces.append(Span(recording, start, start + frames))
        around = [Span(recording, first, start), Span(recording, start + frames, last)]
        rest[index : index + 1] = [span for span in around if span.stop > span.start]
    return rest, sorted(pieces, key=_place)


def _place(span: Span) -> tuple[int, int]:
    return span.recording, span.start
