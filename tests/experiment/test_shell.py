"""The root scripts as processes: help at once, no traceback, any terminal, jobs that fail."""

import os
import subprocess
import sys

import pytest

from tests import command_line
from tests.command_line import ROOT

TINY = ("model=trimodal", "debug=fast", "model.hidden_size=8", "model.layers=1", "logger=none")


def typed(*arguments: str, script: str = "train.py", **environment: str):
    """The process of a command line, in this environment."""
    return subprocess.run(
        [sys.executable, str(ROOT / script), *arguments],
        cwd=ROOT,
        env={**command_line.environment(), **environment},
        capture_output=True,
        text=True,
        timeout=300,
        errors="replace",
    )


def test_help_and_typing_errors_answer_without_importing_what_a_run_needs():
    code = (
        "import sys; sys.argv = ['train.py', *sys.argv[1:]]\n"
        "from cospeech.experiment.command_line import command\n"
        "try:\n    command(lambda cfg: None, 'train.py')\n"
        "except SystemExit as end:\n    print('exit', end.code)\n"
        "print('imported', sorted({'torch', 'lightning', 'scipy'} & set(sys.modules)))"
    )
    for arguments, exit_code in ((["--help"], None), (["model=trimodl"], 1), ([], 1)):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            cwd=ROOT,
            env=command_line.environment(),
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.stdout.rstrip().endswith("imported []"), done.stdout + done.stderr
        assert (f"exit {exit_code}" in done.stdout) == (exit_code is not None)
        assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("script", ["train.py", "evaluate.py", "prepare.py", "generate.py"])
def test_help_and_an_unknown_key(script, tmp_path):
    done = typed("--help", script=script)
    assert done.returncode == 0
    assert f"python {script}" in done.stdout
    assert done.stderr == ""
    done = typed(f"outputs_dir={tmp_path / 'outputs'}", "+export=bvh", script=script)
    assert done.returncode == 1
    assert "error: " in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "outputs").exists()


@pytest.mark.slow
def test_what_users_of_hydra_expect(tmp_path):
    assert "Hydra" in typed("--version").stdout
    assert "Flags" in typed("--hydra-help").stdout
    shown = typed("model=trimodal", "--cfg", "job", "-p", "model").stdout
    assert "hidden_size: 300" in shown
    assert "ablation" in typed("model=trimodal", "--info", "defaults").stdout
    done = typed("--modle=knn")
    assert (done.returncode, "there is no such option" in done.stderr) == (1, True)


@pytest.mark.slow
def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    done = typed(f"outputs_dir={tmp_path / 'file'}", *TINY)
    assert done.returncode == 1
    assert str(tmp_path / "file") in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_an_ascii_terminal_of_five_columns_without_a_home_ends_no_run(tmp_path):
    outputs = tmp_path / "größe"
    environment = {"LANG": "C", "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    environment |= {"COLUMNS": "5", "HOME": str(tmp_path / "absent")}
    done = typed(f"outputs_dir='{outputs}'", *TINY, **environment)
    assert done.returncode == 0, done.stdout + done.stderr
    ((_, record),) = command_line.records(outputs).items()
    assert record["status"] == "ok"
    assert "gr\\xf6\\xdfe" in done.stdout
    assert "Logging error" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux's device that is always full")  # noqa: PTH110
def test_a_reader_that_leaves_and_a_full_disk_under_a_redirection_end_no_run(tmp_path):
    command = " ".join(command_line.arguments(tmp_path, *TINY))
    for redirection in ("| head -1", "> /dev/full 2> /dev/full"):
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", f"{command} {redirection}"],
            cwd=ROOT,
            env=command_line.environment(),
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        assert "BrokenPipe" not in done.stderr
    records = command_line.records(tmp_path).values()
    assert [record["status"] for record in records] == ["ok", "ok"]


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux's device that is always full")  # noqa: PTH110
def test_a_log_on_a_full_disk_adds_no_traceback(tmp_path):
    log = "hydra.job_logging.handlers.file.filename=/dev/full"
    done = typed(f"outputs_dir={tmp_path}", *TINY, "model.context=mime", log)
    assert done.returncode == 1
    assert "context='mime'" in done.stderr
    assert "Logging error" not in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_jobs_of_a_sweep_fail_alone_and_are_summed_up(tmp_path):
    done = typed(
        f"outputs_dir={tmp_path}", *TINY, "test=false", "model.context=video,text,mime", "-m"
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    summary = done.stderr.partition("2 of the jobs failed:")[2]
    for context in ("video", "mime"):
        assert f"model.context={context}" in summary
        assert f"context='{context}' is not one of both, audio, text" in summary
    (left,) = (path for path in (tmp_path / "studies").glob("*/*") if path.is_dir())
    assert '"status": "ok"' in (left / "record.json").read_text()


@pytest.mark.slow
def test_a_folder_of_the_users_own_is_as_it_was_after_a_command_that_failed(tmp_path):
    mine = tmp_path / "mine"
    (mine / "csv").mkdir(parents=True)
    (mine / "csv" / "measured.csv").write_text("a,b\n")
    (mine / "notes.log").write_text("mine\n")
    run = tmp_path / "run"
    run.mkdir()
    done = typed(
        f"outputs_dir={tmp_path / 'out'}", *TINY, "model.context=mime", f"hydra.run.dir={mine}"
    )
    assert done.returncode == 1
    assert (mine / "csv" / "measured.csv").read_text() == "a,b\n"
    assert (mine / "notes.log").read_text() == "mine\n"
    done = typed(f"outputs_dir={tmp_path / 'out'}", *TINY, "model.context=mime", f"run_dir={run}")
    assert done.returncode == 1
    assert not list(run.iterdir())
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_checkpoint_of_other_settings_names_them(tmp_path):
    trained = typed(f"outputs_dir={tmp_path}", *TINY, "test=false")
    assert trained.returncode == 0, trained.stderr
    ((folder, _),) = command_line.records(tmp_path).items()
    checkpoint = folder / "checkpoints" / "last.ckpt"
    for resumed in ("last", str(checkpoint)):
        done = typed(f"outputs_dir={tmp_path}", *TINY, "model.layers=2", f"ckpt_path={resumed}")
        assert done.returncode == 1
        assert "model.layers was 1, is 2" in done.stderr
        assert "Traceback" not in done.stderr
