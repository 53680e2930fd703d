"""The schedule as pure values."""

import json
from itertools import pairwise

import pytest

from cospeech.methods.multi_adversary.stages import (
    STAGES,
    Curriculum,
    CurriculumRules,
    Progress,
    Schedule,
    snapshot_steps,
)

RULES = CurriculumRules(levels=3, accuracy=0.7, streak=3, most_batches=6)
SCHEDULE = Schedule(
    {
        "classifier": 2,
        "pretraining": 3,
        "phase_curriculum": None,
        "motion_pretraining": 1,
        "adversarial": 4,
    },
    RULES,
)


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
    assert not after([0.8] * 8).is_complete(RULES)
    assert after([0.8] * 9).is_complete(RULES)


def walk(schedule, done=frozenset(), accuracy=1.0):
    progress, stages = Progress(schedule.first(done)), []
    while progress.stage != "finished":
        stages.append(progress.stage)
        told = accuracy if progress.stage == "phase_curriculum" else None
        progress = progress.after_step(schedule, told)
        if progress.stage_is_complete(schedule):
            progress = Progress(schedule.next_after(progress.stage, done))
    return stages


def test_the_stages_follow_one_another_for_their_lengths():
    expected = ["classifier"] * 2 + ["pretraining"] * 3 + ["phase_curriculum"] * 9
    expected += ["motion_pretraining"] + ["adversarial"] * 4
    assert walk(SCHEDULE) == expected
    assert Progress("classifier").least_steps_left(SCHEDULE, frozenset()) == len(expected)
    assert len(walk(SCHEDULE, accuracy=0.0)) == len(expected) + 9


def test_stages_that_are_done_are_left_out():
    done = frozenset({"classifier", "phase_curriculum"})
    expected = ["pretraining"] * 3 + ["motion_pretraining"] + ["adversarial"] * 4
    assert walk(SCHEDULE, done) == expected
    assert Progress("pretraining").least_steps_left(SCHEDULE, done) == len(expected)


def test_the_steps_that_are_left_count_down_by_one():
    progress, left = Progress("classifier"), []
    while progress.stage != "finished":
        left.append(progress.least_steps_left(SCHEDULE, frozenset()))
        told = 1.0 if progress.stage == "phase_curriculum" else None
        progress = progress.after_step(SCHEDULE, told)
        if progress.stage_is_complete(SCHEDULE):
            progress = Progress(SCHEDULE.next_after(progress.stage))
    assert left == list(range(19, 0, -1))
    assert progress.least_steps_left(SCHEDULE, frozenset()) == 0
    hard = Progress("phase_curriculum", 9, after([0.5] * 6 + [0.8] * 2))
    assert hard.least_steps_left(SCHEDULE, frozenset()) == 1 + 3 + 1 + 4


def test_progress_survives_a_checkpoint():
    progress = Progress("phase_curriculum", 9, after([0.5] * 6 + [0.8] * 2))
    assert Progress.from_dict(json.loads(json.dumps(progress.to_dict()))) == progress
    assert Progress.from_dict(progress.to_dict()) == progress


def test_stages_are_numbered_from_one():
    assert [Progress(stage).number for stage in STAGES] == [1, 2, 3, 4, 5, 6]


def test_snapshots_are_spaced_evenly_in_their_logarithm():
    assert snapshot_steps(1000, 5) == (0, 1, 10, 100, 1000)
    assert snapshot_steps(5000, 2) == (0, 5000)
    assert snapshot_steps(3, 20) == (0, 1, 2, 3)
    twenty = snapshot_steps(5000, 20)
    assert (twenty[0], twenty[-1]) == (0, 5000)
    assert list(twenty) == sorted(set(twenty))
    ratios = [b / a for a, b in pairwise(twenty[10:])]
    assert ratios == pytest.approx([5000 ** (1 / 18)] * len(ratios), rel=0.02)
