"""What surrounds a run's work may fail; the work goes on, and its end is told as it was."""

import csv
import logging
import signal

import pytest
from lightning.pytorch.loggers import CSVLogger

from cospeech.experiment.enduring import costs_itself, enduring, other_arithmetic
from cospeech.experiment.stopping import STOP_SIGNALS, stopped_like_ctrl_c


def test_an_error_beside_the_work_is_a_warning_of_one_line(caplog):
    with caplog.at_level(logging.WARNING), costs_itself("the page"):
        raise ValueError("no such joint\nand more")
    assert caplog.messages == ["the page is not written: no such joint"]


def test_ctrl_c_beside_the_work_is_heard():
    with pytest.raises(KeyboardInterrupt), costs_itself("the page"):
        raise KeyboardInterrupt


def test_a_logger_that_fails_says_so_once_and_then_rests(tmp_path, monkeypatch, caplog):
    logger = enduring(CSVLogger(tmp_path, name="csv"))
    calls = []

    def full():
        calls.append(1)
        raise OSError(28, "No space left on device", "metrics.csv")

    monkeypatch.setattr(logger.experiment, "save", full)
    with caplog.at_level(logging.WARNING):
        for step in range(3):
            logger.log_metrics({"loss": 1.0}, step)
            logger.save()
        logger.finalize("success")
    assert len(calls) == 1
    (said,) = caplog.messages
    assert "CSVLogger" in said
    assert "No space left on device: 'metrics.csv'" in said


def test_a_logger_that_is_well_writes_everything(tmp_path):
    logger = enduring(CSVLogger(tmp_path, name="csv"))
    for step in range(3):
        logger.log_metrics({"loss": float(step)}, step)
    logger.finalize("success")
    with (tmp_path / "csv" / "version_0" / "metrics.csv").open() as file:
        assert [row["loss"] for row in csv.DictReader(file)] == ["0.0", "1.0", "2.0"]


@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_signal_that_ends_a_process_is_heard_as_ctrl_c_inside(number):
    before = signal.getsignal(number)
    with stopped_like_ctrl_c(), pytest.raises(KeyboardInterrupt, match=number.name):
        signal.raise_signal(number)
    assert signal.getsignal(number) is before


def test_what_nohup_ignores_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stopped_like_ctrl_c():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ctrl_c_works_again_after_a_run_that_lightning_ended():
    before = signal.getsignal(signal.SIGINT)
    with stopped_like_ctrl_c():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGINT) is before


def test_what_the_last_bits_depend_on_is_compared():
    before = {"hardware": {"torch_threads": 2, "gpus": []}, "versions": {"torch": "2.6.0"}}
    now = {
        "hardware": {"torch_threads": 8, "gpus": [], "device": "1 x cpu"},
        "versions": {"torch": "2.6.0"},
    }
    assert other_arithmetic(before, now) == ["torch_threads: 2 before, 8 from here on"]
    assert other_arithmetic(before, before) == []
    assert other_arithmetic({}, now) == []
    assert other_arithmetic({"hardware": "gone", "versions": None}, now) == []
