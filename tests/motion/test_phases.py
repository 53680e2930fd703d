"""Labels of frames from segments of time, and the merges of classes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.motion.phases import (
    FIVE_CLASSES,
    FOUR_CLASSES,
    FOUR_CLASSES_REST_OTHER,
    PHASE_INDEX,
    PHASE_MERGES,
    PHASES,
    SIX_CLASSES,
    STROKE_CLASSES,
    PhaseSegment,
    frame_phases,
)


def names(labels) -> list[str]:
    return [PHASES[label] for label in labels]


def test_a_frame_on_a_boundary_belongs_to_the_later_segment():
    segments = [PhaseSegment(0.1, 0.3, "preparation"), PhaseSegment(0.3, 0.5, "stroke")]
    # Frames at 0, 0.1, ..., 0.6 s.
    assert names(frame_phases(segments, 7, 10.0)) == [
        "none", "preparation", "preparation", "stroke", "stroke", "none", "none",
    ]  # fmt: skip


def test_of_overlapping_segments_the_later_start_counts():
    long, inside = PhaseSegment(0.0, 1.0, "hold"), PhaseSegment(0.4, 0.6, "stroke")
    expected = ["hold"] * 4 + ["stroke"] * 2 + ["hold"] * 4
    assert names(frame_phases([long, inside], 10, 10.0)) == expected
    assert names(frame_phases([inside, long], 10, 10.0)) == expected


def test_of_segments_that_start_together_the_later_in_the_list_counts():
    segments = [PhaseSegment(0.0, 0.3, "hold"), PhaseSegment(0.0, 0.1, "stroke")]
    assert names(frame_phases(segments, 3, 10.0)) == ["stroke", "hold", "hold"]


def test_segments_beyond_the_frames_do_no_harm():
    segments = [PhaseSegment(-5.0, 0.1, "retract"), PhaseSegment(0.2, 1e9, "hold")]
    assert names(frame_phases(segments, 4, 10.0)) == ["retract", "none", "hold", "hold"]
    assert len(frame_phases(segments, 0, 10.0)) == 0


@given(
    st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2), st.sampled_from(PHASES)), max_size=8),
    st.sampled_from([7.0, 15.0, 25.0, 29.97, 60.0]),
)
def test_every_frame_has_the_label_of_the_moment_it_shows(raw, fps):
    segments = [PhaseSegment(min(a, b), max(a, b), label) for a, b, label in raw]
    labels = frame_phases(segments, 40, fps)
    for i, label in enumerate(labels):
        time = i / fps
        if any(abs(time - edge) < 1e-6 for s in segments for edge in (s.start_s, s.end_s)):
            continue
        showing = [s for s in segments if s.start_s <= time < s.end_s]
        wanted = max(showing, key=lambda s: s.start_s).label if showing else "none"
        starts = [s.start_s for s in showing]
        if len(set(starts)) == len(starts):
            assert PHASES[label] == wanted


@pytest.mark.parametrize("merge", PHASE_MERGES.values(), ids=PHASE_MERGES)
def test_every_class_has_a_label_and_every_label_a_class(merge):
    assert len(merge.class_of) == 9
    assert set(merge.class_of) == set(range(len(merge.classes)))


def test_the_published_merges():
    """Ferstl et al. 2020, section 3.2, label by label."""
    six = [SIX_CLASSES.classes[i] for i in SIX_CLASSES(np.arange(9))]
    assert six == [
        "preparation", "hold", "stroke", "hold", "hold", "hold",
        "partial_retract", "retract", "none",
    ]  # fmt: skip
    four = [FOUR_CLASSES.classes[i] for i in FOUR_CLASSES(np.arange(9))]
    assert four == [
        "preparation", "hold", "stroke", "hold", "hold", "hold",
        "other", "other", "other",
    ]  # fmt: skip
    assert STROKE_CLASSES(np.arange(9)).tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("pair", [(SIX_CLASSES, FOUR_CLASSES), (FOUR_CLASSES, STROKE_CLASSES)])
def test_each_merge_goes_on_from_the_one_before(pair):
    finer, coarser = pair
    for class_index in range(len(finer.classes)):
        labels = [i for i in range(9) if finer.class_of[i] == class_index]
        assert len({coarser.class_of[label] for label in labels}) == 1


def test_rest_is_a_hold_or_other_and_its_own_class_of_the_uci_set():
    rest = PHASE_INDEX["rest_hold"]
    classes = [
        merge.classes[merge.class_of[rest]]
        for merge in (FOUR_CLASSES, FOUR_CLASSES_REST_OTHER, FIVE_CLASSES)
    ]
    assert classes == ["hold", "other", "rest"]
    others = np.delete(np.arange(9), rest)
    assert (FOUR_CLASSES(others) == FOUR_CLASSES_REST_OTHER(others)).all()


def test_merge_keeps_the_shape_and_refuses_what_is_no_label():
    assert STROKE_CLASSES(np.full((2, 3), 2, dtype=np.int8)).tolist() == [[1, 1, 1], [1, 1, 1]]
    with pytest.raises(ValueError, match="-1"):
        FOUR_CLASSES(np.array([0, -1], dtype=np.int8))
    with pytest.raises(ValueError, match="9"):
        FOUR_CLASSES(np.array([9]))
