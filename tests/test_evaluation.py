"""What is judged on, and what is too little for it."""

from types import SimpleNamespace

import pytest

from cospeech.errors import CospeechError
from cospeech.evaluation import evaluate_recordings, reference_rows
from tests.corpora import make_recording, make_store


@pytest.mark.parametrize(
    ("seconds", "windows"),
    [(2.0, 0), (2.4, 1)],  # of 34 frames at 15 fps
)
def test_too_few_recordings_are_counted_and_what_to_do_is_said(tmp_path, seconds, windows):
    takes = [make_recording(f"take{i}", seconds=10, seed=i) for i in range(3)]
    store = make_store(tmp_path, [*takes, make_recording("last", seconds=seconds)])
    with pytest.raises(CospeechError) as caught:
        reference_rows(store, SimpleNamespace(sha256=64 * "0"), "test", seed=0)
    told = f"1 recordings to judge on, the longest of {seconds:.2f} s, hold {windows} evaluation"
    assert told in str(caught.value)
    assert "data.split=time_blocks" in str(caught.value)


def test_recordings_too_short_to_generate_for_are_refused_before_anything_is_made(tmp_path):
    takes = [make_recording(f"take{i}", seconds=10, seed=i) for i in range(3)]
    store = make_store(tmp_path, [*takes, make_recording("last", seconds=2)])
    with pytest.raises(CospeechError, match=r"1 recordings to judge on, the longest of 2\.00 s"):
        evaluate_recordings(None, store, "test", None)
