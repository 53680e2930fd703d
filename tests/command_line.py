"""Runs the real command lines, as a user would, in a process of their own."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

SMALL = (
    "model=trimodal",
    "model.hidden_size=16",
    "model.layers=1",
    "training.batch_size=16",
    "data.minutes=4",
    "data.speakers=2",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "callbacks.render_samples.seconds=3",
    "logger=csv",
)
"""A trimodal model small enough to train in seconds."""


def arguments(outputs: Path, *overrides: str, script: str = "train.py") -> list[str]:
    return [sys.executable, str(ROOT / script), f"outputs_dir={outputs}", *overrides]


def environment() -> dict[str, str]:
    # One thread: what a number is must not depend on how sums are split between threads.
    return {**os.environ, "OMP_NUM_THREADS": "1", "WANDB_MODE": "offline", "COLUMNS": "200"}


def run(
    outputs: Path, *overrides: str, script: str = "train.py", timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        arguments(outputs, *overrides, script=script),
        cwd=ROOT,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=timeout,
    )


def start(outputs: Path, *overrides: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        arguments(outputs, *overrides),
        cwd=ROOT,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def records(outputs: Path) -> dict[Path, dict]:
    """Run folder -> record, oldest first."""
    return {
        path.parent: json.loads(path.read_text())
        for path in sorted(outputs.glob("runs/*/record.json"))
    }
