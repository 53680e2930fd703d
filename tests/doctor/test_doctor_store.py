"""Prepared stores, splits, and the command line."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.__main__ import main
from cospeech.corpus.manifest import write_manifest
from cospeech.corpus.splits import SPLITS, Span
from cospeech.doctor import Check, Severity, check_path, compare, examine_closely
from cospeech.doctor.fingerprints import audio_fingerprints
from cospeech.speech.speech import Speech
from tests.corpora import make_store
from tests.doctor.planted import the_error, with_waveform, write_folder


def in_split(recording, split, **changes):
    return replace(recording, split=split, **changes)


def compared(recordings, by_speakers=False):
    return compare([examine_closely(recording) for recording in recordings], by_speakers)


def test_a_clean_split_passes(takes):
    names = ["train", "train", "train", "train", "val", "test"]
    recordings = [in_split(take, name) for take, name in zip(takes, names, strict=True)]
    assert compared(recordings) == []
    assert compared(recordings, by_speakers=True) == []


def test_a_recording_in_two_splits(takes):
    again = in_split(takes[0], "test", id="again")
    finding = the_error(compared([in_split(takes[0], "train"), takes[1], again]), Check.OVERLAP)
    assert "the same audio and motion" in finding.problem
    assert "train and test" in finding.problem
    same = compared([in_split(takes[0], "train"), in_split(takes[0], "test")])
    assert Check.DUPLICATE in [f.check for f in same if f.severity is Severity.ERROR]


def test_an_excerpt_in_another_split(long_take):
    """Seconds 20 to 45, cut out and moved to the start: as in a challenge's own excerpts."""
    motion = long_take.motion.slice(20 * 60, 45 * 60)
    speech = Speech(long_take.speech.waveform[20 * 16000 : 45 * 16000])
    part = replace(long_take, id="part", split="test", speech=speech, motion=motion)
    whole = replace(long_take, split="train")
    finding = the_error(compared([whole, part]), Check.OVERLAP)
    assert 20 < finding.time_s < 22
    assert "audio and motion" in finding.problem
    only_sound = replace(
        part, motion=replace(motion, positions=motion.positions[::-1].copy(), rotations_local=None)
    )
    finding = the_error(compared([whole, only_sound]), Check.OVERLAP)
    assert "the same audio are" in finding.problem


def test_windows_of_one_video_may_overlap_within_a_split(long_take):
    parts = [
        replace(
            long_take,
            id=f"part{i}",
            split="train",
            speech=Speech(long_take.speech.waveform[i * 16000 : (i + 10) * 16000]),
            motion=long_take.motion.slice(i * 60, (i + 10) * 60),
        )
        for i in (0, 5, 10)
    ]
    assert [f for f in compared(parts) if f.check is not Check.LENGTHS] == []


def test_a_training_speaker_in_the_test_split(takes):
    names = ["train", "train", "test"]
    recordings = [in_split(take, name) for take, name in zip(takes[:3], names, strict=True)]
    recordings[2] = replace(recordings[2], speaker=recordings[0].speaker)
    assert compared(recordings) == []
    finding = the_error(compared(recordings, by_speakers=True), Check.OVERLAP)
    assert takes[0].speaker in finding.problem


def test_fingerprints_do_not_depend_on_where_the_cut_is(long_take):
    waveform = long_take.speech.waveform
    whole = audio_fingerprints(waveform)
    part = audio_fingerprints(waveform[123_457:600_000])
    inner = [t for t in whole.times if 123_457 / 16000 + 0.6 < t < 600_000 / 16000 - 0.6]
    shared = set(whole.hashes.tolist()) & set(part.hashes.tolist())
    assert len(inner) > 20
    assert len(shared) >= len(inner)
    other = audio_fingerprints(np.roll(waveform, 1)[::-1].copy())
    assert not set(whole.hashes.tolist()) & set(other.hashes.tolist())


def test_a_clean_store_passes(takes, tmp_path):
    store = make_store(tmp_path, takes)
    checkup = check_path(store.path)
    assert checkup.findings == []
    assert (checkup.layout, checkup.recordings) == ("store", 6)
    assert check_path(store.path, limit=2).recordings == 2


def test_faults_in_a_store(takes, tmp_path):
    silent = with_waveform(takes[2], np.zeros_like(takes[2].speech.waveform))
    store = make_store(tmp_path, [*takes[:2], silent, *takes[3:]])
    finding = the_error(check_path(store.path).findings, Check.SILENT)
    assert takes[2].id in finding.file


def test_spans_that_overlap(takes, tmp_path):
    store = make_store(tmp_path, takes)
    path = store.path / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["splits"]["test"] = [[0, 100, 200]]
    assert tuple(manifest["splits"]) == SPLITS
    assert Span(*manifest["splits"]["train"][0]).start == 0
    write_manifest(store.path, manifest)
    finding = the_error(check_path(store.path).findings, Check.OVERLAP, 100 / 15)
    assert "6.67 to 13.33 s" in finding.problem


def test_a_store_cut_short(takes, tmp_path):
    store = make_store(tmp_path, takes[:4])
    with (store.path / "audio.bin").open("r+b") as file:
        file.truncate(1000)
    finding = the_error(check_path(store.path).findings, Check.UNREADABLE)
    assert finding.file.endswith("audio.bin")
    assert "delete" in finding.next_step


@pytest.mark.parametrize("scale", ["0", "-1", "1001", "nan", "cm"])
def test_a_unit_that_no_file_has_is_refused_as_by_the_corpora(scale, capsys):
    with pytest.raises(SystemExit):
        main(["doctor", "folder", f"--unit-scale={scale}"])
    assert f"a number from 1e-06 to 1000, not {scale}" in capsys.readouterr().err


def test_the_command_line(takes, tmp_path, capsys):
    folder = tmp_path / "raw"
    folder.mkdir()
    write_folder(folder, takes[:2])
    assert main(["doctor", str(folder), "--workers", "1"]) == 0
    assert "0 errors, 0 warnings" in capsys.readouterr().out
    waveform = takes[0].speech.waveform
    broken = np.clip(waveform * 100, -1, 1)
    write_folder(folder, [with_waveform(takes[0], broken)])
    report = tmp_path / "report.json"
    arguments = ["doctor", str(folder), "--workers", "1", "--json", str(report)]
    assert main(arguments) == 1
    text = capsys.readouterr().out
    assert "ERROR  clipped audio  (1)" in text
    assert "1 errors, 0 warnings" in text
    values = json.loads(report.read_text())
    (finding,) = values["findings"]
    assert finding["check"] == "clipped audio"
    assert finding["severity"] == "error"
    assert finding["file"] == str(folder / f"{takes[0].id}.wav")
    assert values["layout"] == "mocap"
    assert main(["doctor", str(tmp_path / "absent")]) == 2
    assert "is not a folder" in capsys.readouterr().err


def test_the_module_runs_and_needs_no_torch(tmp_path):
    code = (
        "import runpy, sys\n"
        f"sys.argv = ['cospeech.corpus', 'doctor', {str(tmp_path)!r}]\n"
        "try:\n    runpy.run_module('cospeech.corpus', run_name='__main__')\n"
        "except SystemExit as end:\n    print(end.code, 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "2 False"
    assert "nothing that is known" in done.stderr


@pytest.mark.parametrize("limit", [1, 3])
def test_limit(takes, tmp_path, limit):
    assert check_path(make_store(tmp_path, takes).path, limit=limit).recordings == limit
