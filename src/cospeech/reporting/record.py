"""`record.json`: what a run was and what came out, in one file that dashboards read."""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cospeech.errors import InputFileError
from cospeech.files import remove_temporaries, write_text
from cospeech.foreign import read_json
from cospeech.reporting.record_schema import record_problems

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

    Raises:
        InputFileError: There is a record, and it is damaged. It stays as it is.
    """

    def __init__(self, path: Path, facts: dict[str, Any], writes: bool = True) -> None:
        self.path = path
        self._writes = writes
        if writes:
            remove_temporaries(path.parent, path.name)
        self.earlier = earlier = load_record(path) if path.is_file() else {}
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
            "metrics": earlier.get("metrics"),
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


def load_record(path: Path, needs: Sequence[str] = ()) -> dict[str, Any]:
    """A record's values, every known key of the type that it should have, or absent.

    Nothing else of a record may be relied on: it may come from anywhere. Keys that are null, also
    those of the objects in it, are left out.

    Args:
        path: The `record.json`.
        needs: Keys that must be there.

    Raises:
        InputFileError: The file is absent or damaged, a value is of another type, or a key that
            is needed is missing.
    """
    hint = "leave it out, or start the run anew in another folder"
    values = read_json(path, "a record of a run", hint=hint)
    problems = record_problems(values)
    if not problems:
        missing = [key for key in needs if values.get(key) is None]
        problems = [f"has no {', '.join(missing)}: it is cut, or no record"] if missing else []
    if problems:
        raise InputFileError(path, "; ".join(problems), hint=hint)
    return _without_nulls(
        {
            key: _without_nulls(value) if isinstance(value, dict) else value
            for key, value in values.items()
        }
    )


def _without_nulls(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def read_record(path: Path) -> dict[str, Any]:
    """A record's values as `load_record` gives them; empty where the file is damaged."""
    try:
        return load_record(path)
    except InputFileError:
        return {}


def write_json(path: Path, values: Any) -> None:
    """JSON written to a temporary file and moved into place. NaN and infinity become null.

    Raises:
        CospeechError: It can't be written; an older file stays as it is.
    """
    write_text(path, json.dumps(_finite(values), indent=1))


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
    import torch  # here, because to read records needs none of its seconds

    gpus = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
    return {
        "platform": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "torch_threads": torch.get_num_threads(),
        "gpus": gpus,
    }
