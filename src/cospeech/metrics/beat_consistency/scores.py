"""The directed beat score and the mismatched speech that gives its chance level.

Published scores have the raw form. For motion beats at random, ``r`` per second, the distance to
the nearest one is exponential with rate ``2 r``, and S(audio -> motion) has the mean ``2 r sigma
sqrt(pi / 2) erfcx(sqrt(2) r sigma)``, whatever is said: 0.22 for one beat per second and a sigma of
0.1 s, 0.48 for the sigma of 0.3 s that BEAT takes, and 0.82 for three beats per second with that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics.beat_consistency.motion_beats import Times

SIGMA_S = 0.1
"""Seconds by which a beat may miss and still score 0.61."""


def beat_scores(beats: Times, others: Times, sigma_s: float = SIGMA_S) -> NDArray[np.float64]:
    """``exp(-min over b in others of (a - b)^2 / (2 sigma^2))`` of each beat a.

    Their mean is the directed score S(beats -> others) (docs/facts/metrics.md, section 2). Without
    others all are 0.

    Args:
        beats: ``(n,)`` seconds, ascending.
        others: ``(m,)`` seconds, ascending.
        sigma_s: Width of the Gaussian, seconds.

    Returns:
        ``(n,)`` in [0, 1].
    """
    if not len(others):
        return np.zeros(len(beats))
    after = np.searchsorted(others, beats)
    before = others[np.maximum(after - 1, 0)]
    following = others[np.minimum(after, len(others) - 1)]
    distances = np.minimum(np.abs(beats - before), np.abs(beats - following))
    scores: NDArray[np.float64] = np.exp(-np.square(distances) / (2 * sigma_s**2))
    return scores


def lift(score: float, chance: float) -> float:
    """``(score - chance) / (1 - chance)``: 1 for beats that all meet, 0 for chance.

    See docs/facts/metrics.md, section 2.

    Negative where beats avoid one another. NaN for a chance of 1, which leaves nothing to find.
    """
    return (score - chance) / (1 - chance) if chance < 1 else float("nan")


def circular_shifts(duration: float, count: int, rng: np.random.Generator) -> Times:
    """Shifts that make a recording's own speech a mismatched one, ``(count,)`` seconds.

    One in each of ``count`` equal parts of the middle half of the recording, so none is nearer to
    the true time than a quarter of the recording, either way round.
    """
    return duration * (0.25 + 0.5 * (np.arange(count) + rng.random(count)) / count)


def cut_from(beats: Times, source_duration: float, start: float, duration: float) -> Times:
    """Beats of a stretch of speech, whose source is repeated until it is long enough.

    Args:
        beats: ``(m,)`` seconds, of the whole source.
        source_duration: Its length, seconds.
        start: Where in it the stretch begins, seconds.
        duration: How long the stretch is, seconds.
    """
    times = np.sort((beats - start) % source_duration)
    rounds = int(np.ceil(duration / source_duration))
    repeated = (times + source_duration * np.arange(rounds)[:, None]).ravel()
    return repeated[repeated < duration]
