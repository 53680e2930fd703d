"""Modules that are run end without a traceback, whatever stops them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cospeech.terminal import exit_status


@pytest.mark.parametrize(
    ("error", "status", "told"),
    [
        (KeyboardInterrupt(), 130, "stopped"),
        (PermissionError(13, "Permission denied", "some/file"), 2, "some/file: Permission denied"),
        (OSError(28, "No space left on device"), 2, "No space left on device"),
        (MemoryError(), 2, "memory"),
    ],
)
def test_what_stops_a_module_is_one_line(capsys, error, status, told):
    def main():
        raise error

    assert exit_status(main) == status
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "imported"),
    [
        (["train.py", "model=trimodal"], "torch"),
        (["train.py"], "omegaconf"),
        (["prepare.py"], "omegaconf"),
        (["evaluate.py"], "omegaconf"),
        (["generate.py"], "omegaconf"),
        (["-m", "cospeech.corpus", "doctor", "absent"], "re2"),
        (["-m", "cospeech.reporting", "absent"], "re2"),
    ],
)
def test_ctrl_c_while_a_command_imports_what_it_needs_is_one_line(command, imported, tmp_path):
    pressed = "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n"
    # as libraries do
    pressed += "except KeyboardInterrupt:\n    raise ImportError('no core') from None\n"
    (tmp_path / f"{imported}.py").write_text(pressed)
    done = subprocess.run(
        [sys.executable, *command],
        cwd=Path(__file__).parents[1],
        env={**os.environ, "PYTHONPATH": ":".join([str(tmp_path), *filter(None, sys.path)])},
        capture_output=True,
        timeout=300,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"\nstopped\n")


def test_ctrl_c_raises_again_once_there_is_something_to_keep():
    code = (
        # as in a terminal: what a shell starts in the background ignores Ctrl-C
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from cospeech.terminal import exit_status, stop_at_once\n"
        "def main():\n    return signal.getsignal(signal.SIGINT) is signal.default_int_handler\n"
        "stop_at_once()\nprint(main())\nprint(exit_status(main))\n"
        "stop_at_once()\nfrom cospeech.experiment import run_folder\nprint(main())\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nstop_at_once()\n"
        "print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=300)
    assert done.stdout.split() == [b"False", b"True", b"True", b"True"]


def test_a_status_is_passed_on_and_a_bug_keeps_its_traceback():
    assert exit_status(lambda: 1) == 1
    with pytest.raises(KeyError):
        exit_status(lambda: {}["x"])


def test_a_reader_that_leaves_is_no_error():
    code = (
        "import sys; from cospeech.terminal import exit_status\n"
        "def main():\n    print('x' * 10**6)\n    return 0\n"
        "sys.exit(exit_status(main))"
    )
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE, timeout=300
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux's device that is always full")
def test_output_that_is_lost_on_a_full_disk_is_an_error():
    code = (
        "import sys; from cospeech.terminal import exit_status\n"
        "def main():\n    print('a')\n    print('b', file=sys.stderr)\n    return 0\n"
        "sys.exit(exit_status(main))"
    )
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, timeout=300
        )
    assert (done.returncode, done.stderr) == (2, b"b\nerror: stdout: No space left on device\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["cospeech.corpus"],
        ["cospeech.corpus", "doctor"],
        ["cospeech.corpus", "doctor", "absent"],
        ["cospeech.reporting"],
        ["cospeech.reporting", "absent"],
        ["cospeech.judges.phase_classifier"],
        ["cospeech.judges.phase_classifier", "score", "absent", "--classifier", "absent.pt"],
    ],
)
def test_a_missing_argument_or_folder_is_no_traceback(tmp_path, arguments):
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode in (1, 2)
    assert "error: " in done.stderr
    assert "Traceback" not in done.stderr
