"""Commands on terminals that lack characters."""

import io
import logging
import subprocess
import sys

import pytest

from cospeech.terminal import Printable, keep_printing
from tests.reporting.records import record

NAME = "Münster, größer → ∞"


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "Läufe ↓"
    folder.mkdir()
    record(folder, 0, id=NAME, status="failed", error=NAME)
    record(folder, 1)
    return folder


def test_a_stream_that_is_no_file_is_left_alone(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    keep_printing()
    print("ü")
    assert stream.getvalue() == "ü\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    "setting", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}]
)
def test_a_c_locale_ends_no_command(setting, runs):
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "cospeech.reporting", str(runs)],
        capture_output=True, env=environment | setting, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert rb"M\xfcnster" in done.stdout
    assert (runs / "report.html").is_file()


def test_no_terminal_obeys_what_is_logged():
    logged = logging.LogRecord(
        "a", logging.WARNING, "", 0, "%s has %d", ("b\x1b]0;c\nerror: d", 3), None
    )
    assert Printable().filter(logged)
    assert logged.getMessage() == "b\ufffd]0;c error: d has 3"
