"""The random pieces that validate, and what is left for training."""

import numpy as np
import pytest

from cospeech.corpus.splits import Span
from cospeech.corpus.validation_pieces import validation_pieces
from cospeech.errors import ConfigError

SPANS = [Span(0, 0, 9000), Span(2, 300, 6300), Span(3, 0, 400)]


def frames_of(spans):
    return [(span.recording, frame) for span in spans for frame in range(span.start, span.stop)]


def test_every_frame_is_on_one_side():
    rest, pieces = validation_pieces(SPANS, seed=0)
    assert len(pieces) == 13
    assert {piece.stop - piece.start for piece in pieces} == {450}
    together = frames_of(rest) + frames_of(pieces)
    assert len(together) == len(set(together))
    assert set(together) == set(frames_of(SPANS))
    assert pieces == sorted(pieces, key=lambda piece: (piece.recording, piece.start))
    assert Span(3, 0, 400) in rest  # shorter than a piece


def test_the_seed_decides():
    assert validation_pieces(SPANS, seed=1) == validation_pieces(SPANS, seed=1)
    assert validation_pieces(SPANS, seed=1) != validation_pieces(SPANS, seed=2)


def test_every_place_is_as_likely():
    spans = [Span(0, 0, 40), Span(1, 0, 70)]
    starts = [
        piece
        for seed in range(4000)
        for piece in validation_pieces(spans, seed, count=1, piece_s=2.0)[1]
    ]
    places = np.array([10 * 0 + p.start if p.recording == 0 else 11 + p.start for p in starts])
    counts = np.bincount(places, minlength=52)  # 11 starts in the first span, 41 in the second
    assert len(counts) == 52
    assert np.abs(counts - 4000 / 52).max() < 5 * np.sqrt(4000 / 52)


def test_too_little_material_says_what_else_to_do():
    with pytest.raises(
        ConfigError, match=r"13 pieces of 30 s don't fit into 1 .*5\.0 min"
    ) as caught:
        validation_pieces([Span(0, 0, 4500)], seed=0)
    assert "model.protocol=split" in caught.value.hint
    with pytest.raises(ConfigError, match="don't fit"):
        validation_pieces([Span(i, 0, 449) for i in range(100)], seed=0)
