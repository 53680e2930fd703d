"""Statistics of user studies: worked by hand, counted out, and against SciPy's own."""

import itertools

import numpy as np
import pytest
import scipy.stats

from cospeech.metrics import user_study
from cospeech.metrics.user_study import (
    EXACT_PAIRS,
    Answers,
    holm,
    preferences,
    share_interval,
    sign_test,
    signed_rank_test,
)


def test_eight_of_ten_by_hand():
    """Of 1024 courses 1 + 10 + 45 have two or fewer for the second, and as many for the first."""
    assert sign_test(8, 2) == pytest.approx(2 * 56 / 1024)
    assert sign_test(2, 8) == sign_test(8, 2)
    assert sign_test(0, 5) == pytest.approx(2 / 32)
    assert sign_test(5, 5) == 1
    assert sign_test(0, 0) == 1


def test_sign_test_and_interval_are_scipys():
    for first, second in [(0, 1), (1, 0), (3, 9), (14, 15), (168, 32), (900, 1100), (0, 40)]:
        test = scipy.stats.binomtest(first, first + second)
        assert sign_test(first, second) == pytest.approx(test.pvalue, rel=1e-10)
        for level in (0.95, 0.8):
            expected = test.proportion_ci(level, method="exact")
            found = share_interval(first, first + second, level)
            assert found == pytest.approx((expected.low, expected.high), rel=1e-9)


def test_interval_of_all_of_ten_by_hand():
    """The share whose tenth power is 2.5 %: nobody against, so the upper end is 1."""
    assert share_interval(10, 10) == pytest.approx((0.025**0.1, 1))
    assert share_interval(0, 10) == pytest.approx((0, 1 - 0.025**0.1))
    assert share_interval(0, 0) == (0, 1)


def test_holm_by_hand():
    """Four tests: 4 x .01, 3 x .015, then 2 x .02 and 1 x .03, which are not below .045."""
    corrected = holm([0.03, 0.01, 0.02, 0.015])
    np.testing.assert_allclose(corrected, [0.045, 0.04, 0.045, 0.045])
    np.testing.assert_allclose(holm([0.6, 0.4]), [0.8, 0.8])
    np.testing.assert_allclose(holm([0.6, 0.7]), [1, 1])
    np.testing.assert_allclose(holm([0.02, 0.02]), [0.04, 0.04])
    assert holm([]).tolist() == []


def test_holm_rejects_what_the_step_down_procedure_rejects():
    """From the smallest on, until one is above the level over the number of those left."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        p_values = rng.uniform(0, 1, 6) ** 4
        order = np.argsort(p_values)
        rejected = set()
        for left, index in zip(range(6, 0, -1), order, strict=True):
            if p_values[index] > 0.05 / left:
                break
            rejected.add(int(index))
        assert set(np.flatnonzero(holm(p_values) <= 0.05).tolist()) == rejected


@pytest.mark.parametrize("p_values", [[0.1, 1.1], [-0.1], [float("nan")], 0.5])
def test_what_is_no_list_of_p_values_is_refused(p_values):
    with pytest.raises(ValueError, match="between 0 and 1"):
        holm(p_values)


def test_a_table_leaves_ties_out_and_corrects_over_its_rows():
    table = preferences({"human-like": Answers(8, 2, 30), "in sync": Answers(15, 5)})
    assert list(table) == ["human-like", "in sync"]
    first, second = table.values()
    assert first.share == pytest.approx(0.8)
    assert (first.low, first.high) == share_interval(8, 10)
    assert (first.p, second.p) == (sign_test(8, 2), sign_test(15, 5))
    assert first.p_corrected == pytest.approx(first.p)  # the larger of two
    assert second.p_corrected == pytest.approx(2 * second.p)
    nobody = preferences({"q": Answers(0, 0, 3)})["q"]
    assert np.isnan(nobody.share)
    assert (nobody.low, nobody.high, nobody.p) == (0, 1, 1)


@pytest.mark.parametrize("wrong", [-1, 2.5, float("nan"), float("inf")])
def test_what_is_no_count_is_refused(wrong):
    for counts in [(wrong, 3), (3, wrong)]:
        with pytest.raises(ValueError, match="counts"):
            sign_test(*counts)
        with pytest.raises(ValueError, match="counts"):
            share_interval(*counts)
    with pytest.raises(ValueError, match="counts"):
        share_interval(5, 4)
    with pytest.raises(ValueError, match="counts"):
        preferences({"q": Answers(1, 2, wrong)})


@pytest.mark.parametrize("level", [0, 1, 1.5, 95, float("nan")])
def test_a_level_that_is_no_share_is_refused(level):
    with pytest.raises(ValueError, match="between 0 and 1"):
        share_interval(3, 5, level)
    with pytest.raises(ValueError, match="between 0 and 1"):
        preferences({"q": Answers(1, 2)}, level)


def test_signed_ranks_by_hand():
    """Differences 1, 2, 3, 4, -5: of 32 courses, ranks of 5 or less are summed by these ten.

    None, {1}, {2}, {3}, {4}, {5}, {1, 2}, {1, 3}, {1, 4}, {2, 3}.
    """
    assert signed_rank_test([1, 2, 3, 4, 0], [0, 0, 0, 0, 5]) == pytest.approx(2 * 10 / 32)
    assert signed_rank_test([1, 2, 3, 4, 5], [0] * 5) == pytest.approx(2 / 32)
    assert signed_rank_test([3, 3], [3, 3]) == 1
    assert signed_rank_test([], []) == 1


def test_noise_of_floating_point_makes_no_difference_of_ratings():
    assert signed_rank_test([0.1 + 0.2] * 6, [0.3] * 6) == 1
    first, second = [1.3, 2, 0.1, 5], [1, 2.3, 0.4, 4]
    tenfold = [[round(10 * rating) for rating in side] for side in (first, second)]
    assert signed_rank_test(first, second) == signed_rank_test(*tenfold) == 1
    # What is small beside other differences isn't noise.
    assert signed_rank_test([1, 2e-6, 3e-6], [0, 0, 0]) == signed_rank_test([3, 1, 2], [0, 0, 0])
    assert signed_rank_test([5, -1e-6, 2e-6], [0] * 3) == signed_rank_test([3, -1, 2], [0] * 3)


def test_signed_ranks_are_scipys_where_scipy_is_exact():
    rng = np.random.default_rng(1)
    for count in (6, 13, 40):
        first, second = rng.normal(0.4, 1, count), rng.normal(0, 1, count)
        expected = scipy.stats.wilcoxon(first, second, method="exact").pvalue
        assert signed_rank_test(first, second) == pytest.approx(expected, rel=1e-9)


def test_signed_ranks_of_ratings_with_ties_against_all_signs():
    rng = np.random.default_rng(2)
    for _ in range(5):
        first, second = rng.integers(1, 6, 10), rng.integers(1, 6, 10)
        differences = (first - second)[first != second]
        ranks = scipy.stats.rankdata(np.abs(differences))
        found = ranks[differences > 0].sum()
        extreme = abs(found - ranks.sum() / 2)
        sums = [
            np.dot(ranks, signs) for signs in itertools.product((0, 1), repeat=len(differences))
        ]
        share = np.mean(np.abs(np.array(sums) - ranks.sum() / 2) >= extreme - 1e-9)
        assert signed_rank_test(first, second) == pytest.approx(share)


def test_many_pairs_have_the_normal_value(monkeypatch):
    rng = np.random.default_rng(3)
    first, second = np.add(rng.integers(0, 50, (2, EXACT_PAIRS + 30)), [[4], [0]])
    expected = scipy.stats.wilcoxon(first, second, method="approx", correction=True).pvalue
    normal = signed_rank_test(first, second)
    assert normal == pytest.approx(expected, rel=1e-9)
    monkeypatch.setattr(user_study, "EXACT_PAIRS", 10**6)
    assert signed_rank_test(first, second) == pytest.approx(normal, rel=0.1)
    assert signed_rank_test(first, second) != normal


def test_ratings_that_are_no_pairs_are_refused():
    with pytest.raises(ValueError, match="no pairs"):
        signed_rank_test([1, 2], [1])
    with pytest.raises(ValueError, match="finite"):
        signed_rank_test([1, float("nan")], [1, 2])


def test_what_the_paper_says_of_its_second_study_follows_from_its_shares():
    """Kucherenko et al. 2020, section 7.3: every difference is significant.

    Four questions about two kinds of segments, 20 persons with 10 pairs of each kind, and 84 to
    93 % for recorded motion. The paper doesn't print its ties: it holds even if the least share is
    of a tenth of the answers and all others are chance, and would not of half as many.
    """
    names = [f"Q{question}, {kind}" for question in "1234" for kind in ("random", "semantic")]
    everybody = preferences({name: Answers(168, 32) for name in names})
    assert max(row.p_corrected for row in everybody.values()) < 1e-20
    assert all(row.low > 0.78 for row in everybody.values())

    def least(answers):
        others = {name: Answers(10, 10) for name in names[1:]}
        return preferences({names[0]: answers, **others})[names[0]].p_corrected

    assert least(Answers(17, 3)) < 0.05  # 85 % of 20
    assert least(Answers(8, 2)) > 0.05  # 80 % of 10
    assert least(Answers(9, 1)) > 0.05
