"""A killed run continues to the same weights as one that was never stopped."""

import json
import signal
import time

import pytest
import torch

from tests import command_line
from tests.command_line import SMALL

pytestmark = pytest.mark.slow

# The adversary starts at epoch 2: the kill comes before it, the end after.
RUN = (
    *SMALL,
    "metrics.encoder=trained",
    "metrics.encoder_epochs=1",
    "training.epochs=4",
    "model.adversarial_start_epoch=2",
    "test=false",
)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return tmp_path_factory.mktemp("outputs")


@pytest.fixture(scope="module")
def straight(outputs):
    done = command_line.run(outputs, *RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    (folder,) = command_line.records(outputs)
    return folder


def newest(outputs):
    return list(command_line.records(outputs))[-1]


def weights(folder):
    return torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)


def wait_for_epochs(outputs, straight, count):
    """The new run's folder, once its record has so many epochs."""
    deadline = time.monotonic() + 240
    while time.monotonic() < deadline:
        try:
            folder = newest(outputs)
            if folder != straight and (folder / "checkpoints" / "last.ckpt").is_file():
                record = json.loads((folder / "record.json").read_text())
                if len(record["epochs"]) >= count and record["status"] == "running":
                    return folder
        except ValueError:
            pass
        time.sleep(0.05)
    raise TimeoutError("the run made no progress")


def assert_same_end(resumed, straight):
    a, b = weights(resumed), weights(straight)
    assert a["epoch"] == b["epoch"] == 3
    assert a["state_dict"].keys() == b["state_dict"].keys()
    for name, value in b["state_dict"].items():
        assert torch.equal(a["state_dict"][name], value), name
    for mine, other in zip(a["optimizer_states"], b["optimizer_states"], strict=True):
        for key, state in other["state"].items():
            for name, value in state.items():
                assert torch.equal(mine["state"][key][name], value), (key, name)


def test_killed_and_resumed_across_the_warm_up_ends_bit_equal(outputs, straight):
    process = command_line.start(outputs, *RUN)
    try:
        folder = wait_for_epochs(outputs, straight, 1)
    finally:
        process.kill()
        process.communicate()
    assert json.loads((folder / "record.json").read_text())["status"] == "running"
    done = command_line.run(outputs, *RUN, "ckpt_path=last")
    assert done.returncode == 0, done.stdout + done.stderr
    assert newest(outputs) == folder
    assert_same_end(folder, straight)
    record = json.loads((folder / "record.json").read_text())
    assert record["status"] == "ok"
    assert [row["epoch"] for row in record["epochs"]] == [0, 1, 2, 3]


def test_killed_in_the_middle_of_an_epoch_goes_on_from_the_last_timed_checkpoint(outputs, straight):
    often = (
        "callbacks.last_timed.train_time_interval._target_=datetime.timedelta",
        "~callbacks.last_timed.train_time_interval.minutes",
        "+callbacks.last_timed.train_time_interval.milliseconds=1",
    )
    process = command_line.start(outputs, *RUN, *often)
    try:
        folder = wait_for_epochs(outputs, straight, 1)
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline:  # until a checkpoint from inside an epoch is there
            loops = weights(folder)["loops"]["fit_loop"]
            if 0 < loops["epoch_loop.batch_progress"]["current"]["ready"] < 6:
                break
    finally:
        process.kill()
        process.communicate()
    progress = weights(folder)["loops"]["fit_loop"]["epoch_loop.batch_progress"]["current"]
    done = command_line.run(outputs, *RUN, *often, "ckpt_path=last")
    assert done.returncode == 0, done.stdout + done.stderr
    assert progress["ready"] > 0
    assert_same_end(folder, straight)


def test_ctrl_c_saves_and_says_how_to_go_on(outputs, straight):
    process = command_line.start(outputs, *RUN)
    try:
        folder = wait_for_epochs(outputs, straight, 1)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=300)
    finally:
        process.kill()
    assert process.returncode == 130, output
    assert "ckpt_path=last" in output
    assert json.loads((folder / "record.json").read_text())["status"] == "interrupted"
    assert weights(folder)["global_step"] > 0


def test_two_runs_at_once_do_not_disturb_each_other(tmp_path, straight):
    """Both need the corpus and the encoder at once; each ends where a lone run ends."""
    processes = [command_line.start(tmp_path, *RUN) for _ in range(2)]
    outputs = [process.communicate(timeout=300)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0], "\n".join(outputs)
    folders = list(command_line.records(tmp_path))
    assert len(folders) == 2
    for folder in folders:
        assert_same_end(folder, straight)
