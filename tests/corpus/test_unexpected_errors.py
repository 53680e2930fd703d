"""An error that nobody foresaw costs its source, with its place, and the corpus goes on."""

import functools
import logging
import re

import pytest

from cospeech.corpus import packing
from cospeech.corpus.packing import pack_source
from cospeech.corpus.reading import packed_sources
from cospeech.corpus.source import Source, explained
from cospeech.errors import CospeechError
from cospeech.speech.transcript import spread_text
from tests.corpora import make_recording


def read_and_fail(error: Exception):
    yield make_recording("before", seconds=2)
    raise error


def read_one():
    return [make_recording("good", seconds=2)]


def read_endlessly():
    return read_endlessly()


def source(read, *arguments, name="s"):
    return Source(name, functools.partial(read, *arguments), ())


@pytest.mark.parametrize("error", [ZeroDivisionError("by nought"), MemoryError(), KeyError("k")])
def test_it_drops_the_rest_of_the_source_with_type_message_and_place(error):
    packed = pack_source(source(read_and_fail, error), True)
    assert [one.facts["id"] for one in packed.recordings] == ["before"]
    (fault,) = packed.faults
    assert fault.id == "s"
    assert fault.reason.startswith(f"unexpected {type(error).__name__}")
    assert str(error) in fault.reason
    assert re.search(r"\(packing\.py, line \d+\)", fault.reason)
    assert "Traceback" in fault.trace


def test_endless_recursion_counts():
    (fault,) = pack_source(source(read_endlessly), True).faults
    assert fault.reason.startswith("unexpected RecursionError: maximum recursion")


def test_ctrl_c_is_no_fault():
    with pytest.raises(KeyboardInterrupt):
        pack_source(source(read_and_fail, KeyboardInterrupt()), True)


def test_the_place_is_ours_where_a_library_raised():
    (fault,) = pack_source(source(spread_text, 5, 0.0, 1.0), True).faults
    assert re.search(r"unexpected \w+Error: .*\(spreading\.py, line \d+\)", fault.reason)


def test_an_error_that_was_foreseen_is_told_as_it_is():
    error = CospeechError("no header", "add one")
    assert explained(error) is error
    (fault,) = pack_source(source(read_and_fail, error), True).faults
    assert (fault.reason, fault.trace) == (str(error), "")


def test_a_recording_that_breaks_the_packing_costs_itself(monkeypatch):
    def read():
        yield make_recording("one", seconds=2)
        yield make_recording("two", seconds=2)

    real = packing.pack

    def pack(recording, *arguments):
        return 1 / 0 if recording.id == "one" else real(recording, *arguments)

    monkeypatch.setattr(packing, "pack", pack)
    packed = pack_source(source(read), True)
    assert [one.facts["id"] for one in packed.recordings] == ["two"]
    assert [(one.id, one.kind) for one in packed.dropped] == [("one", "unusable motion")]


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_corpus_goes_on_and_the_traceback_is_logged(caplog, workers):
    sources = [
        source(read_and_fail, ZeroDivisionError("by nought"), name="bad"),
        source(read_one, name="good"),
    ]
    with caplog.at_level(logging.DEBUG, "cospeech"):
        bad, good = packed_sources(sources, True, workers)
    assert [one.id for one in bad.faults] == ["bad"]
    assert len(good.recordings) == 1
    (record,) = [record for record in caplog.records if "bad" in record.getMessage()]
    assert record.levelno == logging.DEBUG
    assert "Traceback" in record.getMessage()
    assert "ZeroDivisionError: by nought" in record.getMessage()
