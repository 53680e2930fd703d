"""What schedules mean for each step of a search."""

import logging

import numpy as np
import pytest
import torch

from cospeech.errors import ConfigError
from cospeech.matching.control import Controls, database_mask, parse_criterion, plan_controls
from cospeech.matching.matching import Clip, match
from cospeech.matching.search import MatchingSearch
from cospeech.speech.speech import Word
from tests.matching.control_databases import arms

STEP_S = 8 / 15

WORDS = [("the", 0, 0.1, 0.3), ("big", 0, 2.0, 2.4), ("house", 0, 2.4, 2.9), ("big", 0, 9.0, 9.3)]
LOW, HIGH = "left_wrist_height <= p15", "left_wrist_height >= p85"
FAST = "left_wrist_speed >= p60"
NEVER = "left_wrist_height > 100"


@pytest.fixture(scope="module")
def search():
    return MatchingSearch(arms(40, seed=2, words=WORDS))


def plan(search, entries, steps=10, words=(), when_empty="ignore", closed=None):
    controls = Controls.from_dict({"controls": entries, "when_empty": when_empty})
    return plan_controls(controls, search, steps, words, closed)


def span(where, from_s=None, to_s=None):
    return {"where": where, "from_s": from_s, "to_s": to_s}


def mask(search, *texts):
    masks = [database_mask(parse_criterion(text), search.database) for text in texts]
    return np.logical_and.reduce(masks)


def test_no_controls_leave_everything(search):
    made = plan(search, [])
    assert made.masks == [None] * 10
    assert made.applied == [None] * 10
    assert made.eligible.tolist() == [search.eligible().sum()] * 10
    assert made.fallbacks == ()
    assert plan(search, [span(LOW)], steps=0).masks == []


def test_spans_change_over_time_and_share_their_masks(search):
    made = plan(search, [span(LOW, to_s=3 * STEP_S), span(HIGH, 3 * STEP_S, 6 * STEP_S)])
    assert made.applied == [LOW] * 3 + [HIGH] * 3 + [None] * 4
    np.testing.assert_array_equal(made.masks[0], mask(search, LOW))
    np.testing.assert_array_equal(made.masks[3], mask(search, HIGH))
    assert made.masks[0] is made.masks[2]
    assert made.masks[3] is made.masks[5]
    counts = [int(search.eligible(mask(search, text)).sum()) for text in (LOW, HIGH)]
    assert made.eligible[[0, 3]].tolist() == counts
    assert plan(search, [span(HIGH)], steps=1).masks[0] is made.masks[3]


@pytest.mark.parametrize(
    ("from_s", "to_s", "steps"),
    [
        (None, None, range(10)),
        (0.49 * STEP_S, 2.51 * STEP_S, range(3)),
        (0.51 * STEP_S, 2.49 * STEP_S, range(1, 2)),
        # Half of a step belongs to what begins, not to what ends.
        (0.5 * STEP_S, 2.5 * STEP_S, range(2)),
        (2.5 * STEP_S, 4.5 * STEP_S, range(2, 4)),
        (3.1 * STEP_S, 3.2 * STEP_S, range(3, 4)),
        (3.7 * STEP_S, 4.4 * STEP_S, range(4, 5)),
        (3.9 * STEP_S, 4.05 * STEP_S, range(3, 4)),
        (9.9 * STEP_S, 99, range(9, 10)),
        (11 * STEP_S, 99, range(0)),
    ],
)
def test_a_span_holds_for_the_steps_it_covers_half_of(search, from_s, to_s, steps):
    made = plan(search, [span(LOW, from_s, to_s)])
    assert [i for i, text in enumerate(made.applied) if text] == list(steps)


def test_spans_that_come_too_late_are_said(search, caplog):
    plan(search, [span(LOW, 100, 101)])
    assert "speech ends at 5.33 s, before left_wrist_height <= p15 from 100.00 s" in caplog.text


def test_overlapping_spans_hold_together(search):
    made = plan(search, [span(FAST, to_s=4 * STEP_S), span(HIGH, 2 * STEP_S), span(FAST)])
    both = f"({FAST}) and ({HIGH})"
    assert made.applied[:2] == [FAST] * 2
    assert made.applied[2] == both
    assert made.applied[5] == f"({HIGH}) and ({FAST})"
    np.testing.assert_array_equal(made.masks[2], mask(search, FAST, HIGH))
    assert made.masks[2] is made.masks[3]
    assert 0 < made.eligible[2] < made.eligible[0]


@pytest.mark.parametrize(
    ("when_empty", "text"), [("ignore", None), ("previous", HIGH)], ids=["ignore", "previous"]
)
def test_steps_without_windows_fall_back_and_say_so(search, caplog, when_empty, text):
    entries = [span(HIGH, to_s=2 * STEP_S), span(NEVER, 2 * STEP_S, 5 * STEP_S)]
    with caplog.at_level(logging.WARNING):
        made = plan(search, entries, when_empty=when_empty)
    assert made.applied == [HIGH] * 2 + [text] * 3 + [None] * 5
    assert (made.masks[2] is None) == (text is None)
    done = "no control" if text is None else f"{HIGH} goes on"
    (fallback,) = made.fallbacks
    assert fallback[:2] == pytest.approx((2 * STEP_S, 5 * STEP_S))
    assert fallback[2:] == (NEVER, done)
    assert caplog.messages == [
        f"controls, 1.07 to 2.67 s: no window that may be used has {NEVER}; {done}"
    ]


def test_without_a_step_before_there_is_no_control(search):
    made = plan(search, [span(NEVER)], steps=3, when_empty="previous")
    assert made.applied == [None] * 3
    assert len(made.fallbacks) == 1


def test_an_empty_mask_can_be_an_error(search):
    with pytest.raises(ConfigError, match=r"0\.53 to 1\.07 s: no window .* left_wrist_height > 10"):
        plan(search, [span(NEVER, STEP_S)], when_empty="error")


def test_keywords_replace_the_spans_while_they_are_spoken(search):
    words = [Word("Big!", 2.0, 2.4), Word("house", 2.4, 3.0)]
    made = plan(search, [{"word": "big"}, span(LOW)], words=words)
    # 1.8 s to 2.4 s: the steps that begin at 1.6 s and at 2.13 s.
    assert made.applied == [LOW] * 3 + ['word("big")'] * 2 + [LOW] * 5
    said = database_mask(parse_criterion('word("big")'), search.database)
    np.testing.assert_array_equal(made.masks[3], said)
    # Frames 30 to 35, and frames 135 to 139, which are frames 7 to 11 of the third sequence.
    assert made.eligible[3] == (6 + 7) + (5 + 7)
    elsewhere = plan(search, [{"word": "big", "where": HIGH}], words=words)
    assert elsewhere.applied == [None] * 3 + [HIGH] * 2 + [None] * 5


def test_of_two_keywords_the_longer_one_counts(search):
    words = [Word("big", 2.0, 2.2), Word("house", 2.2, 3.0)]
    entries = [{"word": "big", "where": LOW}, {"word": "house", "where": HIGH}]
    # 1.6 s: big from 1.8 s on; 2.13 s: house until 2.67 s; 2.67 s: house alone.
    assert plan(search, entries, words=words).applied[3:6] == [LOW, HIGH, HIGH]
    same = [{"word": "big", "where": LOW}, {"word": "big", "where": HIGH}]
    assert plan(search, same, words=words).applied[3] == LOW


def test_keywords_without_windows_leave_the_spans(search, caplog):
    words = [Word("tiny", 2.0, 2.4)]
    made = plan(search, [{"word": "tiny"}, span(LOW)], words=words, when_empty="error")
    assert made.applied == [LOW] * 10
    (fallback,) = made.fallbacks
    assert fallback.done == f"{LOW} as without the keyword"
    assert fallback[:2] == pytest.approx((3 * STEP_S, 5 * STEP_S))
    assert 'has word("tiny")' in caplog.text
    alone = plan(search, [{"word": "tiny"}], words=words)
    assert alone.masks == [None] * 10
    assert alone.fallbacks[0].done == "no control"


def test_keywords_need_a_transcript_of_the_speech(search, caplog):
    made = plan(search, [{"word": "big"}, span(LOW)], words=None)
    assert made.applied == [LOW] * 10
    assert "no transcript, so big can't be heard" in caplog.text
    caplog.clear()
    plan(search, [{"word": "big"}], words=())
    plan(search, [span(LOW)], words=None)
    assert caplog.text == ""


def test_what_the_database_lacks_is_an_error():
    search = MatchingSearch(arms(4))
    with pytest.raises(ConfigError, match="no transcripts"):
        plan(search, [{"word": "big"}], words=[Word("big", 0.0, 0.4)])
    with pytest.raises(ConfigError, match="has none"):
        plan(search, [span("phase == stroke")])


def test_closed_sequences_are_not_counted(search):
    said = span('word("big")')
    assert plan(search, [said], closed=np.array([0])).eligible[0] == 12
    shut = plan(search, [said], closed=[0, 2])
    own = plan(search, [span(HIGH)], closed=range(20)).masks[0]
    heights = search.database.poses[:, :, 1, 1].astype(np.float64)
    # Percentiles are of the sequences that are used.
    np.testing.assert_array_equal(own, heights >= np.percentile(heights[20:], 85))
    assert (own != plan(search, [span(HIGH)]).masks[0]).any()
    assert shut.masks == [None] * 10
    assert shut.eligible[0] == 38 * 57


def speech(frames, seed=0):
    return np.random.default_rng(seed).normal(size=(frames, 112)).astype(np.float32)


def seeded():
    return torch.Generator().manual_seed(4)


def test_every_window_taken_has_what_was_asked_for(search):
    entries = [
        span(LOW, to_s=5 * STEP_S),
        span(f"{HIGH} or {FAST}", 5 * STEP_S, 10 * STEP_S),
        span("asymmetry < p40", 8 * STEP_S),
        {"word": "big"},
    ]
    made = plan(search, entries, 15, [Word("big", 12.1 * STEP_S, 12.4 * STEP_S)])
    matched = match(search, Clip(speech(15 * 8), masks=made.masks), seeded())
    for step, (sequence, frame) in enumerate(zip(matched.sequences, matched.frames, strict=True)):
        held = made.masks[step]
        assert held is not None
        assert held[sequence, frame]
        assert held[sequence, frame + 7]
    assert made.applied[12] == 'word("big")'
    assert (matched.sequences[12], matched.frames[12]) in {
        *((0, f) for f in range(23, 36)),
        *((2, f) for f in range(0, 12)),
    }
    counts = [int(search.eligible(mask).sum()) for mask in made.masks]
    assert made.eligible.tolist() == counts
    # Frame by frame: the first and the last of every window are the poses that were measured.
    heights = matched.poses[:40].reshape(5, 8, 4, 3)[:, [0, 7], 1, 1]
    limit = np.percentile(search.database.poses[:, :, 1, 1], 15)
    assert (heights <= limit).all()


def test_what_holds_everywhere_changes_nothing(search):
    clip = Clip(speech(64))
    free = match(search, clip, seeded())
    made = plan(search, [span("left_wrist_height > -100")], 8)
    held = match(search, Clip(clip.audio, masks=made.masks), seeded())
    assert held.sequences.tolist() == free.sequences.tolist()
    np.testing.assert_array_equal(held.poses, free.poses)
    assert made.eligible.tolist() == [search.eligible().sum()] * 8
