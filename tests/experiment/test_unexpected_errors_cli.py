"""A traceback lands in the log file of the command, and not on the terminal."""

import subprocess
import sys

import pytest
from hydra import compose, initialize_config_dir

from tests.command_line import ROOT, environment
from tests.doctor.test_doctor_gate import put_take

SCRIPT = """
import sys
import hydra
from cospeech.experiment import prepare
from cospeech.experiment.command_line import command_line
from cospeech.formats.mocap import reading

read_bvh = reading.read_bvh

def broken(path, **options):
    return 1 / 0 if path.stem == "broken" else read_bvh(path, **options)

reading.read_bvh = broken

@hydra.main(version_base="1.3", config_path=sys.argv.pop(1), config_name="prepare")
def main(cfg):
    command_line(prepare, cfg)

main()
"""


@pytest.mark.parametrize("command", ["prepare", "train", "evaluate", "generate"])
def test_every_command_logs_what_its_terminal_does_not_show(command):
    overrides = ["model=knn"] if command == "train" else []
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        cfg = compose(command, overrides, return_hydra_config=True)
    logging = cfg.hydra.job_logging
    assert logging.loggers.cospeech.level == "DEBUG"
    assert logging.handlers.console.level == "INFO"
    assert "level" not in logging.handlers.file
    assert list(logging.root.handlers) == ["console", "file"]


@pytest.mark.slow
def test_the_traceback_of_a_dropped_take_is_in_the_log_file_alone(tmp_path):
    for name in ("broken", "a", "b", "c"):
        put_take(tmp_path / "takes", name)
    script = tmp_path / "prepare.py"
    script.write_text(SCRIPT)
    settings = ["data=mocap", f"data.root={tmp_path / 'takes'}", f"outputs_dir={tmp_path / 'out'}"]
    paths = {"PYTHONPATH": f"{ROOT}:{ROOT / 'src'}"}
    done = subprocess.run(
        [sys.executable, str(script), str(ROOT / "conf"), *settings],
        capture_output=True,
        text=True,
        env=environment() | paths,
        timeout=300,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "kept:   3 recordings of 4 sources" in done.stdout
    reason = "not usable: broken: unexpected ZeroDivisionError: division by zero (reading.py, line"
    assert reason in done.stdout
    assert "Traceback" not in done.stdout + done.stderr
    (log,) = (tmp_path / "out" / "prepare").glob("*/prepare.log")
    assert "Traceback (most recent call last)" in log.read_text()
    assert "return 1 / 0 if path.stem" in log.read_text()
