"""Systems measured side by side, and the paper's findings held against them."""

import dataclasses

import numpy as np
import pytest

from cospeech.metrics.movement import HOLD_SPEED, JITTER_FREQUENCY
from cospeech.metrics.resampling import Estimate
from cospeech.studies.multi_adversary_figures.findings import (
    AGREES,
    DISAGREES,
    PARTLY,
    UNCLEAR,
    judge,
)
from cospeech.studies.multi_adversary_figures.measured import (
    Number,
    Setting,
    SystemMotion,
    SystemStatistics,
)
from cospeech.studies.multi_adversary_figures.measuring import measure_systems, scattered_positions
from cospeech.studies.multi_adversary_figures.paper import FINDINGS, STATISTICS

ROLES = ("left_elbow", "left_wrist", "right_elbow", "right_wrist", "left_thumb_tip")
BONES = ((0, 1), (2, 3), (1, 4))
REST = np.array(
    [[0.3, 0, 0], [0.3, -0.2, 0.1], [-0.3, 0, 0], [-0.3, -0.2, 0.1], [0.3, -0.3, 0.1]], dtype=float
)


def waving(windows, size, seed):
    """Wrists (and the thumb) on circles of this radius, at 0.5 to 1 turns a second."""
    rng = np.random.default_rng(seed)
    rates, phases = rng.uniform(0.5, 1, (windows, 1)), rng.uniform(0, 2 * np.pi, (windows, 1))
    angles = phases + 2 * np.pi * rates * np.arange(100) / 20
    motion = np.tile(REST, (windows, 100, 1, 1))
    circle = size * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    for joint in (1, 3, 4):
        motion[:, :, joint] += circle
    return motion


def system(name, size, seed=0, phases=None, training_seed=None, repeat=False):
    windows = waving(30, size, seed)
    if repeat:
        windows[:] = windows[0]
    takes = [windows[i : i + 3].reshape(300, 5, 3) for i in range(0, 30, 3)]
    return SystemMotion(
        name, windows, takes, side_by_side=takes, phases=phases, seed=training_seed, fgd=size
    )


def setting(classes=()):
    return Setting(ROLES, BONES, REST, np.repeat(np.arange(10), 3), np.arange(0, 30, 2), classes)


def test_jumps_between_windows_are_measured_in_metres_and_against_the_steps_inside():
    real = system("real", 0.1)
    takes = []
    for k in range(10):
        # Every joint glides 1 cm a step; where the second and third window begin it is 7 cm.
        steps = np.full(300, 0.01)
        steps[[100, 200]] = 0.07
        place = np.cumsum(steps)[:, None, None] * np.array([1.0, 0, 0])
        takes.append(place + np.zeros((300, 5, 3)) + 0.001 * k)
    jumping = dataclasses.replace(system("full", 0.1), side_by_side=takes)
    _, full = measure_systems(setting(), [real, jumping], 0, 20)
    assert full.numbers["window_jump_size"].value == pytest.approx(0.07)
    assert full.numbers["window_jump"].value == pytest.approx(7)


def test_a_system_twice_as_large_is_twice_as_fast_and_far():
    real, full = measure_systems(setting(), [system("real", 0.1), system("full", 0.2)], 0, 100)
    value = {key: estimate.value for key, estimate in full.numbers.items()}
    own = {key: estimate.value for key, estimate in real.numbers.items()}
    assert value["velocity"] == pytest.approx(2 * own["velocity"])
    # the circle around the resting place is the mean pose's
    assert value["range"] == pytest.approx(0.2)
    assert value["range_ratio"] == pytest.approx(2)
    assert value["range_gap"] == pytest.approx(0.1)
    assert value["velocity_area"] == pytest.approx(own["velocity"] * 99 / 20)
    assert value["diversity"] == pytest.approx(2 * own["diversity"])
    assert value["variety"] == pytest.approx(own["variety"])
    assert value["jerk"] == pytest.approx(2 * own["jerk"])
    assert value["jitter"] == pytest.approx(own["jitter"])
    assert value["finger_distance"] == pytest.approx(0.1)
    assert value["fgd"] == 0.2
    # same draws for both: the ratio is 2 on each of them
    np.testing.assert_allclose(full.numbers["range_ratio"].mean.draws, 2)
    low, high = full.numbers["velocity"].interval
    assert low < value["velocity"] < high
    assert full.velocity.shape == (99,)
    assert full.velocity_band.shape == (2, 99)
    assert full.ranges.shape == (1, 15)
    # rigid elbow; wrist and thumb move together
    assert full.bones[2].tolist() == pytest.approx([0.1, 0], abs=1e-9)


def test_real_is_measured_against_halves_of_itself():
    rng = np.random.default_rng(0)
    phases = [np.repeat(rng.integers(0, 2, 30), 10) for _ in range(10)]
    (real,) = measure_systems(setting(("a", "b")), [system("real", 0.1, phases=phases)], 0, 20)
    for key in ("velocity_area", "phase_shares", "phase_transitions", "phase_durations"):
        assert 0 <= real.numbers[key].value < 0.5
        assert real.numbers[key].interval is None
    assert "range_gap" not in real.numbers
    np.testing.assert_allclose(real.phases.shares.sum(), 1)


def test_phases_of_a_system_against_those_of_real():
    labels = np.repeat([0, 1, 0, 1, 0, 1], 50)
    systems = [
        system("real", 0.1, phases=[labels] * 10),
        system("full", 0.1, phases=[labels] * 10),
        system("no_phase", 0.1, phases=[np.zeros(300, dtype=int)] * 10),
    ]
    _, full, no_phase = measure_systems(setting(("a", "b")), systems, 0, 20)
    assert full.numbers["phase_shares"].value == 0
    assert full.phases.mean_durations_s.tolist() == [2.5, 2.5]
    assert no_phase.numbers["phase_transitions"].value == 1
    # one phase lasts 2.5 s here and 15 s there, the other never comes
    assert no_phase.numbers["phase_durations"].value == 1


def test_training_seeds_are_one_system():
    systems = [
        system("real", 0.1),
        system("full", 0.1, seed=1, training_seed=4),
        system("full", 0.3, seed=1, training_seed=7),
    ]
    _, full = measure_systems(setting(), systems, 0, 20)
    assert full.seeds == (4, 7)
    assert full.numbers["range"].by_seed == pytest.approx({4: 0.1, 7: 0.3})
    assert full.numbers["range"].value == pytest.approx(0.2)
    assert full.ranges.shape == (2, 15)
    assert full.numbers["fgd"].interval is None


def test_repeated_motion_has_no_variety():
    systems = [system("real", 0.1), system("no_minibatch", 0.2, repeat=True)]
    real, collapsed = measure_systems(setting(), systems, 0, 20)
    assert collapsed.numbers["variety"].value == pytest.approx(0, abs=1e-12)
    assert collapsed.numbers["repeated"].value == 1
    assert collapsed.numbers["range_spread"].value == pytest.approx(0, abs=1e-12)
    assert real.numbers["variety"].value > 0.9


def test_scatter_takes_four_positions_per_second_until_two_minutes_are_full():
    first, second = np.zeros((101, 2, 3)), np.zeros((4000, 2, 3))
    first[:, 0, 0], second[:, 0, 0] = np.arange(101), 1000 + np.arange(4000)
    scatter = scattered_positions([first, second])
    assert scatter.shape == (480, 2, 3)
    assert scatter[:21, 0, 0].tolist() == list(range(0, 101, 5))
    assert scatter[21:, 0, 0].tolist() == [1000 + 5 * i for i in range(459)]
    assert len(scattered_positions([first])) == 21


def test_systems_that_can_not_be_compared():
    with pytest.raises(ValueError, match="first system must be 'real'"):
        measure_systems(setting(), [system("full", 0.1)])
    other = SystemMotion("full", waving(29, 0.1, 0), [], [])
    with pytest.raises(ValueError, match=r"full: windows of shape \(29"):
        measure_systems(setting(), [system("real", 0.1), other])


def made(name, values, spread=0.0, seeds=None):
    """A system whose statistics are given; on draws they go up and down by ``spread``."""
    wave = 0 * np.linspace(-1, 1, 100) if name == "real" else np.linspace(-spread, spread, 100)
    numbers = {}
    for key, value in values.items():
        each = value if isinstance(value, tuple) else (value,)
        seeds = (None,) if name == "real" else seeds or tuple(range(len(each)))
        mean = np.mean(each)
        numbers[key] = Number(
            Estimate(mean, mean + wave), dict(zip(seeds, each, strict=True)), None
        )
    nothing = np.zeros(0)
    return SystemStatistics(name, seeds, numbers, nothing, None, nothing, nothing, None, nothing)


def verdict(systems, claim):
    return next(v for v in judge(systems) if claim in v.claim)


FASTER = "faster than real"


def test_a_finding_that_holds_and_one_that_does_not():
    real = made("real", {"velocity": 1.0})
    assert verdict([real, made("no_minibatch", {"velocity": 2.0}, 0.5)], FASTER).answer == AGREES
    found = verdict([real, made("no_minibatch", {"velocity": 0.4}, 0.5)], FASTER)
    assert found.answer == DISAGREES
    part = found.comparisons[0]
    assert (part.smaller, part.larger) == (("real", 1.0), ("no_minibatch", 0.4))


def test_a_finding_within_the_interval_is_unclear():
    real = made("real", {"velocity": 1.0})
    for value in (0.9, 1.1):
        found = verdict([real, made("no_minibatch", {"velocity": value}, 0.5)], FASTER)
        assert found.answer == UNCLEAR
        assert found.comparisons[0].clear is False


def test_a_finding_on_which_seeds_differ_is_unclear():
    real = made("real", {"velocity": 1.0})
    found = verdict([real, made("no_minibatch", {"velocity": (2.0, 3.0, 0.5)})], FASTER)
    assert found.answer == UNCLEAR
    assert found.comparisons[0].seeds_that_agree == (2, 3)


def test_a_factor_widens_the_comparison():
    real = made("real", {"velocity": 1.0})
    slow = made("mse_only", {"velocity": 0.6})
    assert verdict([real, slow], "far slower than real").answer == DISAGREES
    slower = made("mse_only", {"velocity": 0.4})
    found = verdict([real, slower], "far slower than real")
    assert found.answer == PARTLY
    assert found.not_run == ("no_displacement",)
    both = [real, slower, made("no_displacement", {"velocity": 0.3})]
    assert verdict(both, "far slower than real").answer == AGREES


def test_without_an_interval_nothing_is_decided():
    real = made("real", {"velocity": 1.0})
    fast = made("no_minibatch", {"velocity": 2.0})
    for system in (real, fast):
        known = system.numbers["velocity"]
        alone = Estimate(known.value, np.zeros(0))
        system.numbers["velocity"] = dataclasses.replace(known, mean=alone)
    found = verdict([real, fast], FASTER)
    assert (found.comparisons[0].clear, found.answer) == (None, UNCLEAR)


def test_seeds_are_compared_by_their_number():
    full = made("full", {"held": (1.0, 5.0)})
    other = made("no_phase", {"held": (2.0, 0.5)}, seeds=(1, 2))
    found = verdict([made("real", {"held": 9.0}), full, other], "no clear holds")
    agreeing = {part.larger[0]: part.seeds_that_agree for part in found.comparisons}
    assert agreeing["full"] == (1, 1)  # of seed 1 alone: 2.0 < 5.0
    assert agreeing["real"] == (2, 2)


def test_without_its_systems_a_finding_has_no_answer():
    found = verdict([made("real", {"velocity": 1.0})], FASTER)
    assert (found.answer, found.comparisons, found.not_run) == (None, (), ("no_minibatch",))
    nan = made("no_minibatch", {"velocity": float("nan")})
    assert verdict([made("real", {"velocity": 1.0}), nan], FASTER).answer is None


def test_findings_are_about_statistics_that_exist():
    assert {c.statistic for finding in FINDINGS for c in finding.comparisons} <= set(STATISTICS)


def test_every_statistic_is_measured_and_says_its_thresholds():
    phases = [np.repeat([0, 1, 0], 100)] * 10
    systems = [system("real", 0.1, phases=phases), system("full", 0.2, phases=phases)]
    _, full = measure_systems(setting(("a", "b")), systems, 0, 20)
    assert list(full.numbers) == list(STATISTICS)
    assert f"slower than {100 * HOLD_SPEED:g} cm/s" in STATISTICS["held"].meaning
    assert f"above {JITTER_FREQUENCY:g} Hz" in STATISTICS["jitter"].meaning
