"""`record.json`: what a run was and what came out, in one file that dashboards read."""

from __future__ import annotations

import contextlib
import json
import math
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import torch

from cospeech.errors import CospeechError

RECORD_SCHEMA = 1
_PACKAGES = ("cospeech", "torch", "lightning", "torchmetrics", "hydra-core", "numpy", "librosa")


class RunRecord:
    """The record of one run, rewritten atomically at each change.

    Args:
        path: The `record.json`; its content is taken over where the file exists, so that a resumed
            run goes on with the epochs it has.
        facts: ``id``, ``model``, ``data``, ``ablation``, ``seed`` and the resolved ``config``.
        writes: False in all but the first process of a distributed run.

    Attributes:
        values: What the file holds.
        earlier: What it held before, where the run is resumed; else empty.
    """

    def __init__(self, path: Path, facts: dict[str, Any], writes: bool = True) -> None:
        self.path = path
        self._writes = writes
        self.earlier = earlier = read_record(path) if path.is_file() else {}
        self.values: dict[str, Any] = {
            "schema": RECORD_SCHEMA,
            "status": "running",
            "started": earlier.get("started", _now()),
            "finished": None,
            **facts,
            **_commit(),
            "versions": _versions(),
            "hardware": _hardware(),
            "data_fingerprint": earlier.get("data_fingerprint"),
            "encoder": earlier.get("encoder"),
            "timings": earlier.get("timings", {}),
            "epochs": earlier.get("epochs", []),
            "fit": earlier.get("fit"),
            "objective": earlier.get("objective"),
            "final": {},
            "references": {},
            "samples": earlier.get("samples", []),
            "error": None,
        }
        self.write()

    def update(self, **values: Any) -> None:
        """Set top-level values and write."""
        self.values.update(values)
        self.write()

    def add_timing(self, name: str, seconds: float) -> None:
        """Add to the seconds spent on something (resumed runs add up)."""
        timings = self.values["timings"]
        timings[name] = round(timings.get(name, 0.0) + seconds, 3)
        self.write()

    def add_epoch(self, epoch: int, metrics: dict[str, float]) -> None:
        """Set the metrics of an epoch; an epoch run again after a kill replaces its old row."""
        rows = [row for row in self.values["epochs"] if row["epoch"] < epoch]
        self.values["epochs"] = [*rows, {"epoch": epoch, **metrics}]
        self.write()

    def finish(self, status: str, error: str | None = None) -> None:
        """Close the record as ``"ok"``, ``"failed"`` or ``"interrupted"``."""
        self.update(status=status, finished=_now(), error=error)

    def write(self) -> None:
        """Write atomically: a reader sees the old file or the new one."""
        if self._writes:
            write_json(self.path, self.values)


def read_record(path: Path) -> dict[str, Any]:
    """A record's values; empty where the file is damaged."""
    try:
        values = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return values if isinstance(values, dict) else {}


def write_json(path: Path, values: Any) -> None:
    """JSON written to a temporary file and moved into place. NaN and infinity become null.

    Raises:
        CospeechError: It can't be written; what was there is as it was.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("w", encoding="utf-8") as file:
            json.dump(_finite(values), file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise CospeechError(
            f"{path} can't be written ({error.strerror or error})",
            "free some space, or mend the folder's permissions, and give the same command again",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _commit() -> dict[str, Any]:
    """Commit of the source tree and whether it differs from it; None outside a checkout."""
    folder = Path(__file__).parent

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=10
            )
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    commit = git("rev-parse", "HEAD")
    return {"commit": commit, "dirty": None if commit is None else bool(git("status", "--short"))}


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions


def _hardware() -> dict[str, Any]:
    gpus = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
    return {
        "platform": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "torch_threads": torch.get_num_threads(),
        "gpus": gpus,
    }
