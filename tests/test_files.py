"""Files that can't be written: one line that names them, the old file whole, nothing left over."""

import errno
import json
import os
import resource
import stat

import numpy as np
import pytest
import torch

from cospeech.corpus.__main__ import main as corpus_main
from cospeech.errors import CospeechError
from cospeech.files import is_temporary, remove_temporaries, replacing, write_text
from cospeech.formats.phase_files.writing import write_elan, write_phase_table
from cospeech.judges.phase_classifier.confusion_picture import write_confusion
from cospeech.motion.bvh import write_bvh
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PhaseSegment
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.nn.weights_file import write_weights
from cospeech.reporting.__main__ import main as reporting_main
from cospeech.reporting.collect import collect
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.reporting.record import RunRecord, write_json
from cospeech.reporting.report import write_report
from cospeech.speech.speech import SAMPLE_RATE, Speech
from tests.corpora import REST_POSE
from tests.fabricated.mocap import TRINITY_BODY, put_bvh, swinging
from tests.reporting.records import record


@pytest.fixture
def small_files():
    """No file may grow beyond 4 KB, as on a disk with no more room."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def player(path):
    motion = Motion(UPPER_BODY, 15.0, np.repeat(REST_POSE[None], 30, axis=0))
    clip = PlayerClip("a", {"a": motion}, Speech(np.zeros(SAMPLE_RATE, np.float32)))
    return write_player(path, [clip], "a")


def report(path):
    runs = path.parent / "runs"
    if not runs.exists():
        runs.mkdir()
        record(runs)
    return write_report(collect(runs), path)


def bvh(path):
    skeleton = Skeleton("one", ("a",), (-1,), np.zeros((1, 3)))
    rotations = np.zeros((1000, 1, 4), np.float32)
    rotations[..., 3] = 1  # whichever end is the scalar, these turn about one axis
    write_bvh(path, Motion(skeleton, 15.0, np.zeros((1000, 1, 3)), rotations))


PHASES = [PhaseSegment(float(i), i + 1.0, "stroke") for i in range(1000)]

WRITERS = {
    "checkpoint of weights": lambda path: write_weights(path, {"w": torch.zeros(10_000)}),
    "motion": bvh,
    "phase table": lambda path: write_phase_table(path, PHASES),
    "ELAN": lambda path: write_elan(path, PHASES),
    "confusion": lambda path: write_confusion(path, np.eye(30, dtype=int), ["a"] * 30, "title"),
    "text": lambda path: write_text(path, "x" * 10_000),
    "json": lambda path: write_json(path, {"x": "x" * 10_000}),
    "player": player,
    "report": report,
}


@pytest.mark.parametrize("name", WRITERS)
def test_without_room_the_old_file_stays_and_is_named(name, tmp_path, request):
    path = tmp_path / "made.html"
    WRITERS[name](path)
    path.write_text("old")
    before = sorted(tmp_path.rglob("*"))
    request.getfixturevalue("small_files")
    with pytest.raises(CospeechError) as raised:
        WRITERS[name](path)
    assert str(raised.value).startswith(f"{path}: can't be written (File too large)\n")
    assert path.read_text() == "old"
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("code", "reason", "hint"),
    [
        (errno.ENOSPC, "No space left on device", "free some space there"),
        (errno.EROFS, "Read-only file system", "can be written to"),
        (errno.EACCES, "Permission denied", "can be written to"),
    ],
)
def test_the_reason_and_the_next_step_are_said(code, reason, hint, tmp_path, monkeypatch):
    def refuse(temporary, **kwargs):
        raise OSError(code, os.strerror(code), str(temporary))

    monkeypatch.setattr("cospeech.files.Path.touch", refuse)
    with pytest.raises(CospeechError) as raised:
        write_text(tmp_path / "page.html", "text")
    problem, advice = str(raised.value).split("\n")
    assert problem == f"{tmp_path / 'page.html'}: can't be written ({reason})"
    assert hint in advice


def test_a_parent_that_is_a_file_and_a_target_that_is_a_folder_are_named(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "page.html", tmp_path / "folder"):
        with pytest.raises(CospeechError, match="can't be written"):
            write_text(path, "text")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_what_else_goes_wrong_inside_goes_on_up(tmp_path):
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a"):
        _ = 1 / 0
    other = r"a: can't be written \(No such .*: .*other\.wav\)"
    with pytest.raises(CospeechError, match=other), replacing(tmp_path / "a"):
        (tmp_path / "other.wav").read_bytes()
    assert list(tmp_path.iterdir()) == []


def test_names_as_long_as_names_can_be(tmp_path):
    path = tmp_path / ("[n]" * 81 + ".html")
    write_text(path, "text")
    assert path.read_text() == "text"
    left = tmp_path / f".{path.name[:40]}.0123abcd.part"
    left.touch()
    remove_temporaries(tmp_path, path.name)
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_not_complete_is_hidden_and_looks_like_nothing_that_is_read(tmp_path):
    with replacing(tmp_path / "take.bvh") as temporary:
        assert temporary.name.startswith(".")
        assert temporary.suffix not in (".bvh", "")
        assert is_temporary(temporary)
        assert not is_temporary(tmp_path / "take.bvh")


def test_modes_are_those_of_any_new_file(tmp_path):
    umask = os.umask(0o027)
    try:
        write_text(tmp_path / "a", "text")
    finally:
        os.umask(umask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_a_link_is_replaced_not_what_it_points_at(tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "a").symlink_to(tmp_path / "mine")
    write_text(tmp_path / "a", "text")
    assert (tmp_path / "mine").read_text() == "mine"
    assert not (tmp_path / "a").is_symlink()


def test_pipes_and_what_links_point_at_besides_files_are_refused_and_stay(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    for name in ("pipe", "link"):
        with pytest.raises(CospeechError, match="it is not a file") as raised:
            write_text(tmp_path / name, "text")
        assert "name of a new file" in raised.value.hint
    assert stat.S_ISFIFO((tmp_path / "link").stat().st_mode)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.fixture
def typed(tmp_path):
    """Commands that write to a path that is typed."""
    (tmp_path / "runs").mkdir()
    record(tmp_path / "runs")
    corpus = tmp_path / "corpus"
    put_bvh(corpus / "a.bvh", swinging(TRINITY_BODY, "a", 2.0, 10))
    return {
        "report": lambda path: reporting_main([str(tmp_path / "runs"), "--output", str(path)]),
        "doctor": lambda path: corpus_main(["doctor", str(corpus), "--json", str(path)]),
    }


@pytest.mark.parametrize("command", ["report", "doctor"])
def test_a_path_that_is_typed_is_written_behind_links_and_never_a_pipe(command, typed, tmp_path):
    mine = tmp_path / "mine"
    for old in ("old", None):  # or a link to nothing yet
        if old is not None:
            mine.write_text(old)
            (tmp_path / "link").symlink_to(mine)
        else:
            mine.unlink()
        typed[command](tmp_path / "link")
        assert (tmp_path / "link").is_symlink()
        assert mine.read_text()[0] in "<{"
    os.mkfifo(tmp_path / "pipe")
    assert typed[command](tmp_path / "pipe") != 0
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_record_that_cannot_be_written_keeps_its_last_state(tmp_path, request):
    path = tmp_path / "run" / "record.json"
    kept = RunRecord(path, {"id": "a", "config": {}})
    request.getfixturevalue("small_files")
    with pytest.raises(CospeechError, match=r"record\.json: can't be written"):
        kept.update(error="x" * 10_000)
    assert json.loads(path.read_text())["error"] is None
    assert [found.name for found in path.parent.iterdir()] == ["record.json"]


def test_a_resumed_record_removes_what_a_kill_left_and_nothing_else(tmp_path, monkeypatch):
    path, mine = tmp_path / "record.json", tmp_path / ".record.of-mine.json"
    RunRecord(path, {"id": "a", "config": {}})
    mine.write_text("x")
    with monkeypatch.context() as killed:  # nothing of the clean-up happens
        killed.setattr("cospeech.files.Path.replace", lambda *_: None)
        killed.setattr("cospeech.files.Path.unlink", lambda *_, **__: None)
        RunRecord(path, {"id": "b", "config": {}})
    assert len(list(tmp_path.iterdir())) == 3
    RunRecord(path, {"id": "c", "config": {}}, writes=False)
    assert len(list(tmp_path.iterdir())) == 3
    RunRecord(path, {"id": "c", "config": {}})
    assert sorted(tmp_path.iterdir()) == [mine, path]


def test_content_is_on_the_disk_before_its_name_and_then_the_name(tmp_path, monkeypatch):
    flushed = []

    def fsync(handle):
        flushed.append((stat.S_ISDIR(os.fstat(handle).st_mode), (tmp_path / "a").exists()))

    monkeypatch.setattr(os, "fsync", fsync)
    write_text(tmp_path / "a", "text")
    assert flushed == [(False, False), (True, True)]
