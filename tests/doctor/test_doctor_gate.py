"""What the doctor calls an error of body or sound is dropped by `prepare`, in the same words."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.packing import pack_source
from cospeech.corpus.recording import Recording
from cospeech.doctor import Check, Severity, check_path, examined_source
from cospeech.errors import CospeechError
from cospeech.experiment.preparing import what_was_left_out
from cospeech.formats.mocap import ReadingSettings, Voice, find_takes, take_sources
from data_modules.mocap import MocapData
from tests.fabricated.mocap import (
    TRINITY_BODY,
    bursts,
    put_bvh,
    put_text,
    put_wav,
    spoken,
    swinging,
    tsv,
)

SETTINGS = {
    "batch_size": 8, "seed": 0, "val_share": 0.2, "test_share": 0.2, "split_seed": 0,
    "strict": False, "max_recordings": None, "split": "recordings", "frame_rate": None,
    "joint_map": None, "speaker": "folder", "licence": "", "missing_audio": "auto",
}  # fmt: skip


def put_take(folder, name, scale=1.0, turned=False, audio=None, seconds=6.0):
    """A take whose body is scaled or lies with z up."""
    skeleton = replace(TRINITY_BODY, offsets=TRINITY_BODY.offsets * scale)
    if turned:
        x, y, z = skeleton.offsets.T
        skeleton = replace(skeleton, offsets=np.stack([x, -z, y], axis=1))
    motion = swinging(skeleton, name, seconds, 30)
    if turned:  # bent arms would be bent about the wrong axes
        still = np.zeros_like(motion.rotations_local)
        still[..., 3] = 1
        motion = replace(motion, rotations_local=still)
    put_bvh(folder / f"{name}.bvh", motion)
    put_wav(folder / f"{name}.wav", bursts(name, seconds) if audio is None else audio)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for name in ("good1", "good2", "good3"):
        put_take(folder, name)
    put_take(folder, "tiny", scale=0.01)
    put_take(folder, "huge", scale=100.0)
    put_take(folder, "z_up", turned=True)
    put_take(folder, "mute", audio=np.zeros(96000))
    put_take(folder, "loud", audio=np.clip(8 * bursts("loud", 6.0), -0.9, 0.9))
    put_text(folder / "good1.tsv", tsv(spoken("good1", 6.0)))
    put_text(folder / "good2.json", '{"names": ["jawOpen"], "frames": []}')
    put_text(folder / "good3.phases.csv", "0,1,wobble\n")
    return folder


def module(folder, store_dir, **settings):
    return MocapData(root=str(folder), store_dir=str(store_dir), **SETTINGS | settings)


@pytest.fixture(scope="module")
def manifest(folder, tmp_path_factory):
    return module(folder, tmp_path_factory.mktemp("stores")).prepare_store().manifest


@pytest.fixture(scope="module")
def checkup(folder):
    return check_path(folder)


def test_wrong_bodies_and_silence_are_dropped_as_faults(manifest):
    assert sorted(manifest["recordings"]["id"]) == ["good1", "good2", "good3", "loud"]
    faults = {item["id"]: item for item in manifest["skipped"]}
    assert all(item["is_fault"] for item in faults.values())
    kinds = {name: item["kind"] for name, item in faults.items()}
    assert kinds == {
        "tiny": "units", "huge": "units", "z_up": "vertical", "mute": "silent audio",
    }  # fmt: skip
    assert "data.unit_scale=1 " in faults["tiny"]["reason"]
    assert "data.unit_scale=0.0001 " in faults["huge"]["reason"]
    assert "data.up_axis=z" in faults["z_up"]["reason"]


def test_the_doctor_says_the_same_of_them(manifest, checkup):
    told = [finding for finding in checkup.findings if finding.severity is Severity.ERROR]
    for item in manifest["skipped"]:
        (finding,) = [f for f in told if f"/{item['id']}." in f.file and f.check == item["kind"]]
        assert f"{finding.problem}\n  -> {finding.next_step}" in item["reason"]


def test_side_files_that_can_not_be_used_are_warnings_in_the_same_words(folder, manifest, checkup):
    takes = {path.name for path in (folder / "good2.json", folder / "good3.phases.csv")}
    unused = [f for f in checkup.findings if f.check is Check.UNREADABLE]
    assert {finding.file.rpartition("/")[2] for finding in unused} == takes
    assert {finding.severity for finding in unused} == {Severity.WARNING}
    assert all(finding.problem.startswith("not used as ") for finding in unused)
    kinds = {kind: advice for kind, advice, _ in manifest["remarks"]}
    assert {finding.next_step for finding in unused} <= set(kinds.values())


def test_the_summary_counts_takes_by_finding_and_says_what_to_type(manifest):
    text = what_was_left_out(manifest)
    assert "dropped as faults:  2 takes: units; 1 take: silent audio; 1 take: vertical" in text
    for line in (
        "3 takes: no transcript",
        "1 take: without a transcript",
        "1 take: without gesture phases",
        "1 take: clipped audio",
    ):
        assert line in text.splitlines()
    assert "'data.phase_labels={wobble: stroke}'" in text


def test_the_summary_has_each_kind_s_different_advice():
    manifest = {
        "skipped": [],
        "recordings": {"id": list("abcdefgh"), "has_words": [True] * 8},
        "sources": 8,
        "window_grid": None,
        "dropped_windows": {},
        "remarks": [["odd", "do this", 2], ["odd", "do that", 1], ["clear", "", 1]]
        + [["many", f"advice {i}", 1] for i in range(7)],
    }
    lines = what_was_left_out(manifest).splitlines()
    place = lines.index("2 takes: odd")
    assert lines[place : place + 4] == [
        "2 takes: odd",
        "  -> do this",
        "1 take: odd",
        "  -> do that",
    ]
    assert lines.count("1 take: many") == 4
    assert "3 more: many, each with advice of its own: see the log" in lines


def test_the_labels_of_a_corpus_are_said_once_to_both(folder, tmp_path):
    data = module(folder, tmp_path, phase_labels={"Wobble!": "stroke"})
    (source,) = [source for source in data.sources if source.id == "good3"]
    (recording,) = source.read()
    assert isinstance(recording, Recording)
    assert recording.phases is not None
    assert data.settings()["phase_labels"] == {"Wobble!": "stroke"}
    checkup = check_path(folder, settings=ReadingSettings(phase_labels={"wobble": "stroke"}))
    assert not any("phases" in finding.problem for finding in checkup.findings)


def test_strict_stops_at_the_first(folder, tmp_path):
    with pytest.raises(CospeechError, match=r"huge can't be used: .*upper arm"):
        module(folder, tmp_path, strict=True).prepare_store()


def test_one_who_listens_in_a_dialogue_may_be_silent(folder):
    mute = next(take for take in find_takes(folder) if take.id == "mute")
    (source,) = take_sources([replace(mute, interlocutor=Voice(folder / "good1.wav"))])
    (recording,) = examined_source(source).read()
    assert isinstance(recording, Recording)
    assert [remark.kind for remark in recording.remarks] == ["silent audio"]


def test_an_unexpected_error_is_a_finding_about_its_file(folder, monkeypatch, caplog):
    def broken(path, **_):
        raise ZeroDivisionError("by nought") if path.stem == "good1" else RecursionError

    monkeypatch.setattr("cospeech.formats.mocap.reading.read_bvh", broken)
    checkup = check_path(folder, limit=2)
    assert len(checkup.findings) == 2
    first = checkup.findings[0]
    assert first.file.endswith("good1.bvh")
    assert first.problem.startswith("unexpected ZeroDivisionError: by nought (reading.py, line ")
    assert "the command's log has the traceback" in first.next_step
    logged = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert "good1.bvh" in logged[0].getMessage()
    assert [type(record.exc_info[1]) for record in logged] == [ZeroDivisionError, RecursionError]


def test_motion_without_audio_is_told_of_in_the_words_of_prepare(folder, tmp_path):
    put_bvh(tmp_path / "t.bvh", swinging(TRINITY_BODY, "t", 6.0, 30))
    put_take(tmp_path, "u")
    checkup = check_path(tmp_path)
    (finding,) = [f for f in checkup.findings if f.check is Check.MISSING]
    (source,) = [one for one in module(tmp_path, tmp_path).sources if one.id == "t"]
    (fault,) = pack_source(source, True).faults
    assert finding.problem in fault.reason
    assert "no t.wav/.flac/.ogg/.mp3 for t.bvh; audio found: u.wav" in finding.problem
