"""Statistics of user studies: what a number of preferences or of ratings says.

Pairwise preferences are tested as Kucherenko et al. 2020 do (docs/facts/metrics.md, section 5): a
two-sided binomial test without the ties, corrected by Holm's procedure over all questions of a
study, beside the share that prefers one side with a 95 % interval. Ratings of the same items are
tested by the signed-rank test.

Both tests take answers as independent. Answers of one person, or about one clip, are not quite:
with twenty of each person the p-values are too small. Where there are persons enough, test one
number of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import bdtr, betaincinv, ndtr
from scipy.stats import rankdata

EXACT_PAIRS = 200
"""Pairs up to which the signed-rank test counts all signs; beyond, ranks are as good as normal."""

ROUNDING = 1e-9
"""Of the largest rating: differences that are no further apart are the same."""


class Answers(NamedTuple):
    """How often each answer to one question was given.

    Attributes:
        first: Those for the first side.
        second: Those for the second.
        ties: "No difference".
    """

    first: int
    second: int
    ties: int = 0


class Preference(NamedTuple):
    """What answers to one question say.

    Attributes:
        answers: The counts.
        share: Of the first side among those that are no ties; NaN where there are none.
        low: Lower end of the share's interval.
        high: Upper end.
        p: Of the sign test by itself.
        p_corrected: By Holm's procedure over the family of questions.
    """

    answers: Answers
    share: float
    low: float
    high: float
    p: float
    p_corrected: float


def sign_test(first: int, second: int) -> float:
    """Exact two-sided p-value of "both sides are preferred equally often".

    ``min(1, 2 P(X <= min(first, second)))`` where X is binomial with a share of one half. Ties are
    to be left out, as Kucherenko et al. 2020 do; to halve them would count them as evidence of no
    difference.

    Args:
        first: Answers for one side.
        second: Answers for the other.

    Returns:
        1 where there is no answer.

    Raises:
        ValueError: A count is negative or no whole number.
    """
    _require_counts(first, second)
    return min(1.0, 2 * float(bdtr(min(first, second), first + second, 0.5)))


def share_interval(count: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper and Pearson's interval of a share.

    Its ends are the shares under which ``count`` or more, or ``count`` or fewer, have a probability
    of half of what the level leaves. It covers the true share at least that often.

    Args:
        count: How many prefer the side.
        of: How many answered, without ties.
        level: Between 0 and 1.

    Returns:
        Its ends; 0 and 1 where nobody answered.

    Raises:
        ValueError: A count is negative or no whole number, ``count`` is larger than ``of``, or the
            level isn't between 0 and 1.
    """
    if not 0 < level < 1:
        raise ValueError(f"a level is between 0 and 1, such as 0.95 for 95 %: {level}")
    _require_counts(count, of - count)
    tail = (1 - level) / 2
    low = float(betaincinv(count, of - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, of - count, 1 - tail)) if count < of else 1.0
    return low, high


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """p-values corrected for a family of tests by Holm's procedure (1979).

    The k-th smallest of m, times ``m - k + 1``, is not smaller than those before it, and at most 1.
    To call "significant" what is at most 0.05 then errs in one family of twenty, whichever of its
    hypotheses are true.

    Args:
        p_values: ``(m,)``, of all tests that would have been reported, the dull ones too.

    Returns:
        ``(m,)`` in the same order.

    Raises:
        ValueError: One is not between 0 and 1.
    """
    p_values = np.asarray(p_values, dtype=np.float64)
    if p_values.ndim != 1 or not ((p_values >= 0) & (p_values <= 1)).all():
        raise ValueError("p-values are a list of numbers between 0 and 1")
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty_like(p_values)
    corrected[order] = np.minimum(1, np.maximum.accumulate(factors * p_values[order]))
    return corrected


def preferences(questions: Mapping[str, Answers], level: float = 0.95) -> dict[str, Preference]:
    """A table of preferences: shares with intervals, and p-values corrected over the whole table.

    Args:
        questions: Name -> answers; all of them are one family.
        level: Of the intervals.

    Returns:
        Name -> what its answers say, in the same order.

    Raises:
        ValueError: A count is negative or no whole number, or the level isn't between 0 and 1.
    """
    for answers in questions.values():
        _require_counts(*answers)
    raw = [sign_test(answers.first, answers.second) for answers in questions.values()]
    corrected = holm(raw).tolist()
    table = {}
    for (name, answers), p, p_corrected in zip(questions.items(), raw, corrected, strict=True):
        decided = answers.first + answers.second
        share = answers.first / decided if decided else float("nan")
        low, high = share_interval(answers.first, decided, level)
        table[name] = Preference(answers, share, low, high, p, p_corrected)
    return table


def signed_rank_test(first: Sequence[float], second: Sequence[float]) -> float:
    """Two-sided p-value of Wilcoxon's signed-rank test of pairs (1945).

    The sum of the ranks of positive differences, among all sums that other signs of the same
    differences would give. Differences of 0 are left out, equal sizes share the mean of their
    ranks, and the distribution is that of these very ranks: exact with ties, as ratings have many.
    What is within `ROUNDING` of the largest absolute rating is 0, or equal: means of ratings come
    with the noise of floating point, which is no difference.

    Args:
        first: Ratings of one side, of persons or of clips.
        second: Ratings of the other by the same persons, or of the same clips.

    Returns:
        1 where no pair differs. Beyond `EXACT_PAIRS` by the normal distribution, with a correction
        for continuity.

    Raises:
        ValueError: The sides have different lengths, or a rating is not finite.
    """
    if len(first) != len(second):
        raise ValueError(f"{len(first)} and {len(second)} ratings are no pairs")
    differences = np.subtract(first, second, dtype=np.float64)
    if not np.isfinite(differences).all():
        raise ValueError("ratings are finite numbers")
    noise = ROUNDING * max(np.max(np.abs(side), initial=0.0) for side in (first, second))
    differences = differences[np.abs(differences) > noise]
    # Twice the ranks: the mean of ranks that share is a half at worst.
    ranks = np.rint(2 * rankdata(_levels(np.abs(differences), noise))).astype(np.int64)
    total = int(ranks.sum())
    found = int(ranks[differences > 0].sum())
    extreme = min(found, total - found)
    if len(ranks) > EXACT_PAIRS:
        spread = np.sqrt(np.square(ranks.astype(np.float64)).sum()) / 2
        return min(1.0, 2 * float(ndtr((extreme + 1 - total / 2) / spread)))
    probabilities = np.zeros(total + 1)
    probabilities[0] = 1
    for rank in ranks:
        moved = np.zeros_like(probabilities)
        moved[rank:] = probabilities[: total + 1 - rank]
        probabilities = (probabilities + moved) / 2
    return min(1.0, 2 * float(probabilities[: extreme + 1].sum()))


def _levels(sizes: NDArray[np.float64], noise: float) -> NDArray[np.int64]:
    """From 0 upwards, the same for sizes between which there is no gap of more than the noise."""
    order = np.argsort(sizes)
    levels = np.zeros(len(sizes), dtype=np.int64)
    levels[order[1:]] = np.cumsum(np.diff(sizes[order]) > noise)
    return levels


def _require_counts(*counts: int) -> None:
    if not all(count >= 0 and float(count).is_integer() for count in counts):
        raise ValueError(
            f"counts are whole numbers from 0 on, and parts not larger than the whole: {counts}"
        )
