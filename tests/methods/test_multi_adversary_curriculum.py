"""The curriculum as pure values."""

import json
from itertools import pairwise

import pytest

from cospeech.methods.multi_adversary.curriculum import (
    Curriculum,
    CurriculumRules,
    snapshot_steps,
)

RULES = CurriculumRules(levels=3, accuracy=0.7, streak=3, most_batches=6)


def after(accuracies, rules=RULES):
    state = Curriculum()
    for accuracy in accuracies:
        state = state.after(accuracy, rules)
    return state


def test_three_good_batches_in_a_row_end_a_level():
    assert after([0.7, 0.9]) == Curriculum(level=0, streak=2, batches=2)
    assert after([0.7, 0.9, 0.7]) == Curriculum(level=1, spent=(3,))


def test_a_bad_batch_starts_the_row_anew():
    state = after([0.9, 0.9, 0.69])
    assert (state.level, state.streak, state.batches) == (0, 0, 3)
    assert after([0.9, 0.9, 0.69, 0.9, 0.9]).level == 0
    assert after([0.9, 0.9, 0.69, 0.9, 0.9, 0.9]) == Curriculum(level=1, spent=(6,))


def test_a_level_ends_by_the_limit_and_says_so():
    assert after([0.5] * 5).level == 0
    assert after([0.5] * 6) == Curriculum(level=1, spent=(6,), capped=(0,))
    assert after([0.5] * 6 + [0.8] * 3) == Curriculum(level=2, spent=(6, 3), capped=(0,))


def test_the_last_level_must_be_passed_too():
    assert after([0.8] * 8).least_steps_left(RULES) == 1
    assert after([0.8] * 9).least_steps_left(RULES) == 0


def test_what_is_left_counts_as_if_every_batch_were_good():
    assert Curriculum().least_steps_left(RULES) == 9
    assert after([0.8, 0.8]).least_steps_left(RULES) == 7
    assert after([0.8, 0.8, 0.1]).least_steps_left(RULES) == 9
    assert after([0.5] * 6 + [0.8] * 2).least_steps_left(RULES) == 4


def test_a_curriculum_survives_a_checkpoint():
    state = after([0.5] * 6 + [0.8] * 2)
    assert Curriculum.from_dict(json.loads(json.dumps(state.to_dict()))) == state
    assert Curriculum.from_dict(state.to_dict()) == state


def test_snapshots_are_spaced_evenly_in_their_logarithm():
    assert snapshot_steps(1000, 5) == (0, 1, 10, 100, 1000)
    assert snapshot_steps(5000, 2) == (0, 5000)
    assert snapshot_steps(3, 20) == (0, 1, 2, 3)
    twenty = snapshot_steps(5000, 20)
    assert (twenty[0], twenty[-1]) == (0, 5000)
    assert list(twenty) == sorted(set(twenty))
    ratios = [b / a for a, b in pairwise(twenty[10:])]
    assert ratios == pytest.approx([5000 ** (1 / 18)] * len(ratios), rel=0.02)
