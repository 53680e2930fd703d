"""Gesture phases in time, against numbers worked out by hand and against a plain loop."""

import itertools

import numpy as np
import pytest

from cospeech.metrics.phase_structure import (
    count_phases,
    phase_distances,
    phase_structure,
)

FPS = 20.0


def test_phases_of_a_short_recording():
    structure = phase_structure([count_phases(np.array([0, 0, 1, 1, 1, 0]), 3, 2.0)], 2.0)
    np.testing.assert_allclose(structure.shares, [0.5, 0.5, 0])
    np.testing.assert_allclose(structure.mean_durations_s, [0.75, 1.5, np.nan])
    np.testing.assert_allclose(
        structure.transitions, [[0, 1, 0], [1, 0, 0], [np.nan, np.nan, np.nan]]
    )
    np.testing.assert_allclose(structure.pairs, [[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]])
    # bins from 0.5, 1 and 1.4 s on
    np.testing.assert_allclose(structure.durations[0, [4, 6]], [0.5, 0.5])
    assert structure.durations[1, 7] == 1


def test_recordings_add_up_without_a_transition_between_them():
    counts = [count_phases(np.array(labels), 2, FPS) for labels in ([0, 0, 1], [0, 1, 1, 1])]
    structure = phase_structure(counts, FPS)
    np.testing.assert_allclose(structure.shares, [3 / 7, 4 / 7])
    np.testing.assert_allclose(structure.mean_durations_s, [1.5 / FPS, 2 / FPS])
    np.testing.assert_allclose(structure.transitions, [[0, 1], [np.nan, np.nan]])


def test_a_duration_on_an_edge_is_in_the_longer_bin():
    labels = np.array([0] * 3 + [1] * 10 + [0] * 5)
    durations = count_phases(labels, 2, FPS).durations
    # 0.15 s and 0.25 s begin the second and the third bin, 0.5 s the fifth
    assert np.flatnonzero(durations[0]).tolist() == [1, 2]
    assert np.flatnonzero(durations[1]).tolist() == [4]


def test_phases_against_a_loop():
    rng = np.random.default_rng(3)
    labels = np.repeat(rng.integers(0, 4, 200), rng.integers(1, 30, 200))
    runs = [(key, len(list(group))) for key, group in itertools.groupby(labels.tolist())]
    structure = phase_structure([count_phases(labels, 4, FPS)], FPS)
    for phase in range(4):
        lengths = [length for key, length in runs if key == phase]
        assert structure.mean_durations_s[phase] == pytest.approx(np.mean(lengths) / FPS)
        followers = [b for (a, _), (b, _) in itertools.pairwise(runs) if a == phase]
        expected = np.bincount(followers, minlength=4) / len(followers)
        np.testing.assert_allclose(structure.transitions[phase], expected)


def test_jensen_shannon_distances():
    half = phase_structure([count_phases(np.array([0, 1] * 10), 2, FPS)], FPS)
    one = phase_structure([count_phases(np.zeros(20, dtype=int), 2, FPS)], FPS)
    same = phase_distances(half, half)
    assert same == (0, 0, 0)
    # of (1/2, 1/2) and (1, 0), middle (3/4, 1/4): H(3/4, 1/4) - H(1/2, 1/2) / 2 bits
    divergence = -(0.75 * np.log2(0.75) + 0.25 * np.log2(0.25)) - 0.5
    distances = phase_distances(half, one)
    assert distances.shares == pytest.approx(np.sqrt(divergence))
    assert distances.transitions == 1
    # one step against 20, and there against never
    assert distances.durations == 1


def test_labels_that_are_no_class():
    with pytest.raises(ValueError, match="for 2 classes"):
        count_phases(np.array([0, 2]), 2, FPS)
