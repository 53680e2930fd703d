"""What numba compiles can be imported wherever the package is installed."""

import os
import shutil
from pathlib import Path

import pytest

import cospeech


@pytest.fixture
def read_only(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(cospeech.os, "access", lambda folder, mode: False)
    kept = []
    monkeypatch.setattr(cospeech.atexit, "register", lambda *call, **named: kept.append(call))
    return kept


def test_without_a_home_a_folder_of_the_process_is_used_and_removed(
    read_only, monkeypatch, tmp_path
):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    cospeech._let_numba_cache()
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.is_dir()
    assert folder.stat().st_mode & 0o077 == 0  # what lies there is run
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert (shutil.rmtree, str(folder)) in read_only
    folder.rmdir()


def test_a_writable_home_is_numbas_own_choice(read_only, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cospeech._let_numba_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_a_folder_that_the_user_names_stays(read_only, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "mine")
    cospeech._let_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == "mine"
