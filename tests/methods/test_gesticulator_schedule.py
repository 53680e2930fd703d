"""The picture of the schedule in the method's README is what the schedule does."""

import re
from pathlib import Path

import pytest

import cospeech.methods.gesticulator
from cospeech.methods.gesticulator.schedule import history_of_epoch

README = Path(cospeech.methods.gesticulator.__file__).with_name("README.md")


def drawn(schedule, epoch):
    history = history_of_epoch(epoch, schedule, first=10, frames=40)
    if not history.is_conditioned:
        return "." * 40
    return "".join("T" if reset else "o" for reset in history.is_reset.tolist())


@pytest.mark.parametrize("schedule", ["paper", "released"])
def test_the_picture_is_of_the_schedule(schedule):
    text = README.read_text(encoding="utf-8")
    (block,) = re.findall(rf"^{schedule}(?: \(default\))?\n((?:epoch .*\n)+)", text, re.MULTILINE)
    lines = re.findall(r"^epoch (\d+)( to \d+| on)? +([.To]+)$", block, re.MULTILINE)
    assert [int(first) for first, _, _ in lines] == [0, 7, 8, 9, 10, 11]
    for first, until, picture in lines:
        last = {" to 6": 6, " on": 300, "": int(first)}[until]
        assert all(drawn(schedule, epoch) == picture for epoch in range(int(first), last + 1))
