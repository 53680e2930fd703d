"""Whatever a run is doing when it is killed, its files are whole and it goes on from there."""

import csv
import json
import os
import resource
import signal
import sqlite3
import subprocess
import time
from pathlib import Path

import pytest
import torch

from cospeech.nn.checkpoints import previous_of
from cospeech.nn.weights_file import read_checkpoint
from tests import command_line
from tests.command_line import SMALL
from tests.killing import killed_writing

pytestmark = [pytest.mark.slow, pytest.mark.timeout(2400)]

PATIENCE = 600
"""Seconds that anything may take on a busy machine."""

RUN = (*SMALL, "logger=none", "training.batch_size=64", "test=false")

REFINED = (
    "model=knn_cgan",
    "model.generator_width=8",
    "model.critic_width=8",
    "model.critic_updates=6",
    "model.pair_stride=32",
    "training.batch_size=8",
    "data.minutes=4",
    "data.speakers=2",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "logger=none",
)
"""A method that ends its training itself, which nothing but the record tells afterwards."""

RECORD = """
import sys
from pathlib import Path
from cospeech.reporting.record import RunRecord

facts = {"id": "x", "model": "m", "data": "d", "ablation": "full", "seed": 0, "config": {}}


def write(number):
    record = RunRecord(Path(sys.argv[1]), facts)
    record.add_epoch(number, {f"val/{name}": float(number) for name in range(2000)})
"""

PLAYER = """
import sys
import numpy as np
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.speech.speech import Speech

motion = Motion(UPPER_BODY, 15.0, np.zeros((30, 10, 3), np.float32))
speech = Speech(np.zeros(32000, np.float32))


def write(number):
    write_player(sys.argv[1], [PlayerClip("clip", {"recorded": motion}, speech)], str(number))
"""

REPORT = """
import sys
from pathlib import Path
from cospeech.reporting.collect import collect
from cospeech.reporting.record import RunRecord
from cospeech.reporting.report import write_report

page = Path(sys.argv[1])
facts = {"id": "x", "model": "m", "data": "d", "ablation": "full", "seed": 0, "config": {}}
record = RunRecord(page.parent / "runs" / "x" / "record.json", facts)
record.finish("ok")
collection = collect(page.parent / "runs")


def write(number):
    write_report(collection, page)
"""


@pytest.mark.parametrize(
    ("script", "name"), [(RECORD, "record.json"), (PLAYER, "player.html"), (REPORT, "report.html")]
)
def test_killed_at_any_moment_of_its_writing_a_file_is_whole(script, name, tmp_path):
    path = tmp_path / name
    for _, written in killed_writing(script, str(path), times=12):
        text = path.read_text(encoding="utf-8")
        if name == "record.json":
            epochs = [row["epoch"] for row in json.loads(text)["epochs"]]
            assert epochs[-1] in (written, written + 1)
            assert epochs == list(range(1, epochs[-1] + 1))
        else:
            assert text.endswith("</html>\n")


def wait_until(found, process, what):
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        if (value := found()) is not None:
            return value
        if process.poll() is not None:
            raise AssertionError(f"the run has ended before: {process.stdout.read()}")
        time.sleep(0.01)
    raise TimeoutError(what)


def the_record(outputs):
    """The newest run's folder and record."""
    try:
        return list(command_line.records(outputs).items())[-1]
    except (IndexError, ValueError, FileNotFoundError):
        return None


def epochs_done(outputs, count):
    def found():
        folder, record = the_record(outputs) or (None, {"epochs": []})
        return folder if len(record["epochs"]) >= count else None

    return found


def test_killed_or_stopped_in_its_final_evaluation_a_run_gains_no_epoch(tmp_path):
    def fit_ended():
        _, record = the_record(tmp_path) or (None, {"fit": None})
        return record["fit"]

    process = command_line.start(tmp_path, *REFINED)
    try:
        wait_until(fit_ended, process, "the training did not end")
    finally:
        process.kill()
        process.communicate()
    folder, killed = the_record(tmp_path)
    assert killed["status"] == "running"
    assert killed["final"] == {}

    process = command_line.start(tmp_path, *REFINED, "ckpt_path=last")
    try:
        wait_until(lambda: the_record(tmp_path)[1]["timings"].get("test"), process, "no evaluation")
        process.terminate()
        output, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    record = the_record(tmp_path)[1]
    if record["status"] != "ok":  # it may have been done a moment before
        assert process.returncode == 130, output
        assert "ckpt_path=last" in output
        assert record["status"] == "interrupted"
        done = command_line.run(tmp_path, *REFINED, "ckpt_path=last", timeout=PATIENCE)
        assert done.returncode == 0, done.stdout + done.stderr
    assert the_record(tmp_path)[0] == folder
    record = the_record(tmp_path)[1]
    assert record["status"] == "ok"
    assert record["epochs"] == killed["epochs"]
    assert record["final"]["recordings"]["fgd"] >= 0


def test_stopped_before_its_training_a_run_says_interrupted(tmp_path):
    process = command_line.start(
        tmp_path, *RUN, "metrics.encoder=trained", "metrics.encoder_epochs=500"
    )
    try:
        wait_until(
            lambda: next(iter(tmp_path.glob("stores/*/encoders/*.lock")), None), process, "encoder"
        )
        time.sleep(1)
        process.terminate()
        output, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 130, output
    assert the_record(tmp_path)[1]["status"] == "interrupted"


def test_a_full_disk_costs_nothing_that_was_saved(tmp_path):
    done = command_line.run(tmp_path, *RUN, "training.epochs=1", timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    folder, _ = the_record(tmp_path)
    last = folder / "checkpoints" / "last.ckpt"
    before = last.read_bytes()
    more = (*RUN, "training.epochs=3", "ckpt_path=last")

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    full = subprocess.run(
        command_line.arguments(tmp_path, *more),
        cwd=command_line.ROOT,
        env=command_line.environment(),
        preexec_fn=small_files,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert full.returncode == 1
    assert "Traceback" not in full.stderr
    (line,) = [line for line in full.stderr.splitlines() if line.startswith("error: ")]
    assert ".ckpt: can't be written (File too large); the one before it is whole" in line
    assert last.read_bytes() == before
    assert the_record(tmp_path)[1]["status"] == "failed"
    done = command_line.run(tmp_path, *more, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [row["epoch"] for row in the_record(tmp_path)[1]["epochs"]] == [0, 1, 2]
    assert read_checkpoint(previous_of(last), "")["epoch"] == 1

    # A refused command leaves no folder; the others stay.
    absent = ("model=trimodal", "data=mocap", f"data.root={tmp_path / 'absent'}")
    refused = command_line.run(tmp_path, *absent, timeout=PATIENCE)
    assert refused.returncode == 1
    assert "absent" in refused.stderr
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [folder.name]


@pytest.mark.parametrize("logger", ["wandb", "mlflow", "tensorboard"])
def test_killed_while_it_logs_a_run_goes_on_and_its_logs_are_readable(logger, tmp_path):
    pytest.importorskip(logger)
    run = (*RUN, f"logger={logger}", "training.epochs=2", "trainer.log_every_n_steps=1")
    process = command_line.start(tmp_path, *run)
    try:
        wait_until(epochs_done(tmp_path, 1), process, "no epoch")
    finally:
        process.kill()
        process.communicate()
    done = command_line.run(tmp_path, *run, "ckpt_path=last", timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    folder, record = the_record(tmp_path)
    assert [row["epoch"] for row in record["epochs"]] == [0, 1]
    if logger == "tensorboard":
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

        events = EventAccumulator(str(folder / "tensorboard"))
        events.Reload()
        assert "val/fgd" in events.Tags()["scalars"]
        return
    with (folder / "csv" / "version_1" / "metrics.csv").open() as file:
        assert list(csv.DictReader(file))
    if logger == "wandb":
        assert len(list(folder.glob("wandb/offline-run-*/run-*.wandb"))) >= 1
        return
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        assert database.execute("pragma integrity_check").fetchone() == ("ok",)
        assert database.execute("select count(*) from metrics").fetchone()[0] > 0


def processes_below(pid):
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                state, parent = (folder / "stat").read_text().rpartition(")")[2].split()[:2]
                rank = b"LOCAL_RANK=1" in (folder / "environ").read_bytes()
            except OSError:
                continue
            if int(parent) == pid and rank and state != "Z":
                found.append(int(folder.name))
    return found


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="finds processes in /proc")
@pytest.mark.parametrize("killed", ["first", "second"])
def test_of_two_processes_the_other_ends_and_the_run_goes_on(killed, tmp_path):
    run = (*RUN, "trainer=ddp", "training.epochs=3")
    process = command_line.start(tmp_path, *run)
    try:
        folder = wait_until(epochs_done(tmp_path, 1), process, "no epoch")
        (second,) = processes_below(process.pid)
        os.kill(process.pid if killed == "first" else second, signal.SIGKILL)
        output, _ = process.communicate(timeout=PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while is_alive(second) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not is_alive(second)
    finally:
        process.kill()
    assert process.returncode != 0, output
    done = command_line.run(tmp_path, *run, "ckpt_path=last", timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    assert the_record(tmp_path)[0] == folder
    assert the_record(tmp_path)[1]["status"] == "ok"
    assert [row["epoch"] for row in the_record(tmp_path)[1]["epochs"]] == [0, 1, 2]
    assert torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)["epoch"] == 2
