"""What goes wrong around a build: nothing in the way, nobody left behind, nothing kept too long."""

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from cospeech.corpus.packing import pack, pack_source
from cospeech.corpus.reading import packed_sources
from cospeech.corpus.recording import WindowList
from cospeech.corpus.source import Source
from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation import evaluate_recordings, standard_catalogue
from cospeech.speech.speech import Speech, Word
from tests.corpora import make_recording, make_store

SPEC = WindowSpec(fps=15, frames=34, seed_frames=4, stride=10)


def unreadable():
    raise CospeechError("install the codec first")


def nothing():
    return []


def killed():
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_build_without_a_recording_is_not_gone_on_with(tmp_path):
    """Its sources are read again: what was missing may have been installed since."""
    source = Source("s", unreadable, ())
    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        writer.append(pack_source(source, True))
        with pytest.raises(CospeechError, match="install the codec"):
            writer.columns()["frames"]
    assert not list(tmp_path.iterdir())


def test_a_folder_in_the_way_does_not_cost_the_build(tmp_path):
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "notes.txt").write_text("mine")
    with pytest.raises(CospeechError, match="in the way"):
        make_store(tmp_path)
    (tmp_path / "made" / "notes.txt").unlink()
    with StoreWriter(tmp_path / "made", "made", {"made": True}, "0" * 64) as writer:
        assert writer.recording_count == 6
        spans = {name: [Span(i, 0, 150)] for i, name in enumerate(("train", "val", "test"))}
        assert len(writer.finish(spans).recordings) == 6


def test_a_reader_that_is_killed_is_an_error_with_a_way_out():
    sources = [Source(f"s{i}", killed, ()) for i in range(12)]
    with pytest.raises(CospeechError, match=r"was killed(.|\n)*workers=1"):
        list(packed_sources(sources, True, workers=2))


def test_a_reader_that_is_killed_between_two_sources_is_the_same_error():
    """The pool is found broken when it is given more, not when it is asked for a result."""
    sources = [Source(str(i), nothing, ()) for i in range(4)]
    sources += [Source(f"s{i}", killed, ()) for i in range(8)]
    packed = packed_sources(sources, True, workers=2)
    found = [next(packed).id]  # asking for the next one hands out the first that kills
    time.sleep(2)
    with pytest.raises(CospeechError, match="was killed"):
        found += [source.id for source in packed]
    assert found == ["0", "1", "2", "3"][: len(found)]


@pytest.mark.skipif(sys.platform == "win32", reason="processes are listed by /proc")
def test_readers_end_with_a_parent_that_was_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        "import functools, os, pathlib, sys, time\n"
        "from cospeech.corpus.reading import packed_sources\n"
        "from cospeech.corpus.source import Source\n"
        "def read(folder):\n"
        "    (pathlib.Path(folder) / f'{os.getpid()}.pid').touch()\n"
        "    return []\n"
        "if __name__ == '__main__':\n"
        "    folder = sys.argv[1]\n"
        "    sources = [Source(str(i), functools.partial(read, folder), ()) for i in range(4)]\n"
        "    for _ in packed_sources(sources, True, 2):\n"
        "        time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, str(script), str(tmp_path)])
    try:
        pids = wait_for(lambda: [int(path.stem) for path in tmp_path.glob("*.pid")])
    finally:
        parent.kill()
        parent.wait()
    assert pids
    assert wait_for(lambda: not any(running(pid) for pid in pids))


def wait_for(condition, seconds=200):
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.1)
    return condition()


def running(pid):
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_words_out_of_order_are_put_in_order():
    words = (Word("late", 2.0, 2.5), Word("early", 0.5, 0.9), Word("between", 1.0, 1.2))
    packed = pack(make_recording("a", words=words))
    assert packed.texts == ["early", "between", "late"]
    rows = np.frombuffer(packed.data["words"]).reshape(-1, 3)
    assert rows[:, 0].tolist() == [0.5, 1.0, 2.0]


def test_an_empty_window_list_is_refused():
    none = np.zeros(0, np.int64)
    with pytest.raises(ValueError, match="empty window list"):
        pack(dataclasses.replace(make_recording("a"), windows=WindowList(15, 42, 10, none, none)))


def test_audio_from_before_the_recording_is_silence(tmp_path):
    store = make_store(tmp_path)
    audio = store.audio(0, -10, 30)
    assert not audio[:10].any()
    np.testing.assert_allclose(audio[10:], np.arange(20) / 16_000, atol=5e-5)
    assert not store.audio(0, -50, 30).any()


def test_fewer_windows_than_processes_are_an_error(tmp_path, monkeypatch):
    dataset = WindowDataset(make_store(tmp_path), "val", SPEC, frozenset({"positions"}))
    monkeypatch.setattr("cospeech.corpus.window_loader._world", lambda: (0, 13))
    with pytest.raises(ConfigError, match="12 val windows can't be shared by 13 processes"):
        WindowLoader(dataset, 4, 0, shuffle=True, drop_last=True)


class Encoder:
    def encode_all(self, positions):
        return torch.zeros(len(positions), 32)


class Mute:
    training = False

    def eval(self):
        return self

    def train(self, mode=True):
        return self

    def generate(self, speech, **_):
        assert len(speech.waveform), "asked to generate for a recording without sound"
        raise RuntimeError("asked")


def test_recordings_without_sound_are_not_generated_for(tmp_path, caplog):
    silent = Speech(np.zeros(0, np.float32), None)
    recordings = [make_recording(f"t{i}", seed=i) for i in range(4)]
    recordings[3] = dataclasses.replace(recordings[3], speech=silent)
    store = make_store(tmp_path, recordings)
    everything = [Span(i, 0, 150) for i in range(4)]
    assert [span.recording for span in store.spans_with_sound(everything, "this")] == [0, 1, 2]
    assert "1 of 4 recordings" in caplog.text
    with pytest.raises(CospeechError, match="no recording has sound"):
        evaluate_recordings(Mute(), store, "test", Encoder(), standard_catalogue())
    store.splits["test"] = everything[::-1]
    with pytest.raises(RuntimeError, match="asked"):
        evaluate_recordings(Mute(), store, "test", Encoder(), standard_catalogue())
