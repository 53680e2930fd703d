"""A record is the old one or the new one, and a disk that is full is named."""

import errno
import json
import os

import pytest

from cospeech.errors import CospeechError
from cospeech.reporting.record import RunRecord, write_json

FACTS = {"id": "x", "model": "m", "data": "d", "ablation": "full", "seed": 0, "config": {}}


def test_a_full_disk_leaves_the_old_file_and_is_named(tmp_path, monkeypatch):
    path = tmp_path / "record.json"
    write_json(path, {"a": 1})

    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CospeechError, match="No space left on device") as caught:
        write_json(path, {"a": 2})
    assert str(path) in caught.value.problem
    assert "\n" not in caught.value.problem
    assert json.loads(path.read_text()) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(CospeechError, match=r"record\.json: can't be written \(.+\)"):
        write_json(tmp_path / "file" / "record.json", {})


def test_a_resumed_record_knows_what_it_was(tmp_path):
    first = RunRecord(tmp_path / "record.json", FACTS)
    first.add_epoch(0, {"val/fgd": 1.0})
    first.update(fit={"asked": 1, "ended": 1}, objective=1.0)
    first.finish("interrupted", "stopped")
    second = RunRecord(tmp_path / "record.json", FACTS)
    assert second.earlier["status"] == "interrupted"
    assert second.values["status"] == "running"
    assert second.values["epochs"] == [{"epoch": 0, "val/fgd": 1.0}]
    assert second.values["fit"] == {"asked": 1, "ended": 1}
    assert second.values["objective"] == 1.0


def test_nulls_of_an_earlier_record_are_as_good_as_nothing(tmp_path):
    path = tmp_path / "record.json"
    nulls = dict.fromkeys(("started", "epochs", "fit", "samples", "encoder"))
    write_json(path, {"timings": {"fit": None}, **nulls})
    record = RunRecord(path, FACTS)
    record.add_timing("fit", 2.5)
    record.add_epoch(0, {"val/fgd": 1.0})
    assert record.values["timings"] == {"fit": 2.5}
    assert record.values["started"] is not None
    assert record.values["samples"] == []


def test_a_damaged_record_stays_as_it_is(tmp_path):
    path = tmp_path / "record.json"
    path.write_text('{"seed": "0"}')
    with pytest.raises(CospeechError, match="seed is a text"):
        RunRecord(path, FACTS)
    assert path.read_text() == '{"seed": "0"}'
