"""Reading the records of many runs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cospeech.errors import CospeechError, InputFileError
from cospeech.reporting.record import load_record
from cospeech.reporting.run_state import is_at_work

RECORD = "record.json"
PROTOCOLS: tuple[str, ...] = ("windows", "recordings")
"""The two ways a run is judged; their numbers are not comparable with one another."""

_MOST_SAMPLES = 100
_LIMITS = ("fast_dev_run", "overfit_batches")
# settings that name the run or watch it, and do not change its numbers
_NOT_SETTINGS = (
    "seed",
    "ckpt_path",
    "run_dir",
    "run_prefix",
    "outputs_dir",
    "study_name",
    "choices",
    "callbacks",
    "logger",
    "hydra",
    "data.store_dir",
    "data.workers",
    "model.products_dir",
    "metrics.catalogue",
)
CATALOGUE = "metrics.catalogue."
"""What the settings of metrics begin with."""


@dataclass(frozen=True, eq=False)
class Run:
    """One record.

    Attributes:
        folder: The run's folder.
        values: Content of its ``record.json``, of the types that `load_record` promises.
        at_work: Whether its process is alive; None where that can't be told.
    """

    folder: Path
    values: Mapping[str, Any]
    at_work: bool | None = None

    @property
    def id(self) -> str:
        """The run's id, or its folder's name."""
        return str(self.values.get("id") or self.folder.name)

    @property
    def status(self) -> str:
        """``ok``, ``failed``, ``interrupted``, ``running`` or ``unknown``.

        A run that was killed could not write so: it is ``interrupted``, or ``running?`` where
        nobody can tell whether it was.
        """
        status = str(self.values.get("status") or "unknown")
        if status != "running" or self.at_work:
            return status
        return "running?" if self.at_work is None else "interrupted"

    @property
    def error(self) -> str:
        """The first line of what ended the run; empty where nothing did."""
        if self.values.get("status") == "running":
            return "killed before it could say so" if self.status == "interrupted" else ""
        lines = str(self.values.get("error") or "").strip().splitlines()
        return lines[0] if lines else ""

    @property
    def is_debug(self) -> bool:
        """Whether it saw a few batches alone (``debug=fast``): its numbers mean nothing."""
        config = self.mapping("config")
        if config.get("choices", {}).get("debug"):
            return True
        trainer = config.get("trainer")
        return isinstance(trainer, Mapping) and any(
            bool(value) and not (isinstance(value, float) and value == 1)
            for key, value in trainer.items()
            if key in _LIMITS or (key.startswith("limit_") and key.endswith("_batches"))
        )

    @property
    def space(self) -> tuple[str | None, str | None]:
        """Corpus fingerprint and encoder hash; numbers of two spaces are not comparable."""
        return self.values.get("data_fingerprint"), self.mapping("encoder").get("sha256")

    @property
    def seed(self) -> Any:
        """The run's seed; None when not recorded."""
        return self.values.get("seed")

    def mapping(self, key: str) -> Mapping[str, Any]:
        """A top-level object of the record; empty when absent."""
        value: Mapping[str, Any] = self.values.get(key, {})
        return value

    def final(self, protocol: str) -> Mapping[str, Any]:
        """Final metrics under a protocol."""
        value: Mapping[str, Any] = self.mapping("final").get(protocol, {})
        return value

    def epochs(self) -> list[Mapping[str, Any]]:
        """Metrics per epoch, in order."""
        return sorted(self.values.get("epochs", []), key=lambda row: row["epoch"])

    def samples(self) -> list[Path]:
        """The run's player pages and videos that exist, inside its folder."""
        names = self.values.get("samples", [])
        root = self.folder.resolve()
        paths = [self.folder / name for name in names[-_MOST_SAMPLES:] if _is_inside(root, name)]
        return list(dict.fromkeys(paths))

    def settings(self) -> dict[str, Any]:
        """The resolved config as dotted keys, without what names or watches the run."""
        flat = flatten(self.mapping("config"))
        return {
            key: value
            for key, value in flat.items()
            if not any(f"{key}.".startswith(f"{name}.") for name in _NOT_SETTINGS)
            and not (key.rsplit(".", 1)[-1] == "seed" and value == self.seed)
            and not (isinstance(value, str) and self.id in value)
        }

    def metrics(self) -> dict[str, dict[str, Any]]:
        """Name -> settings of each metric that the run was judged by, as dotted keys."""
        found: dict[str, dict[str, Any]] = {}
        for key, value in flatten(self.mapping("config")).items():
            if key.startswith(CATALOGUE):
                name = key.removeprefix(CATALOGUE).partition(".")[0]
                found.setdefault(name, {})[key] = value
        return found


@dataclass(frozen=True, eq=False)
class Collection:
    """The records under a folder.

    Attributes:
        folder: Where they were looked for.
        runs: Readable records, by folder name.
        damaged: File and reason of each that is not used.
    """

    folder: Path
    runs: list[Run]
    damaged: list[tuple[Path, str]]


def number(value: Any) -> float | None:
    """A JSON number as float; None for anything else, booleans included."""
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def flatten(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one with dotted keys; lists stay whole."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{name}.")
        else:
            flat[name] = value
    return flat


def collect(folder: str | Path) -> Collection:
    """Read every ``record.json`` under a folder. Nothing is written there, and no lock is left.

    A link to a run's folder is followed, other links are not.

    Raises:
        CospeechError: The folder does not exist, or there is no record under it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CospeechError(
            f"{folder}: no such folder", "give outputs/runs or outputs/studies/NAME"
        )
    runs: list[Run] = []
    damaged: list[tuple[Path, str]] = []
    for path in _records(folder):
        try:
            if path.is_symlink():
                raise InputFileError(path, "is a link, which is not followed")
            values = load_record(path)
        except InputFileError as error:
            damaged.append((path, error.problem.removeprefix(str(path)).lstrip(":, ")))
        else:
            at_work = is_at_work(path.parent) if values.get("status") == "running" else None
            runs.append(Run(path.parent, values, at_work))
    if not runs and not damaged:
        raise CospeechError(f"{folder}: no record.json under it", "train something first: train.py")
    return Collection(folder, runs, damaged)


def _records(folder: Path) -> list[Path]:
    found: dict[Path, Path] = {}
    for place, folders, files in os.walk(folder):
        inside = [Path(place, name) for name in folders]
        runs = [path for path in inside if path.is_symlink() and (path / RECORD).is_file()]
        for run in (*([Path(place)] if RECORD in files else []), *runs):
            # a folder and a link to it are one run, and it is shown where it lies
            real = run.resolve()
            if real not in found or not run.is_symlink():
                found[real] = run / RECORD
    return sorted(found.values())


def _is_inside(root: Path, name: str) -> bool:
    """Whether a name is that of a file under a folder, without links or ways out on the way."""
    try:
        path = root / name
        return path.is_relative_to(root) and path.is_file() and path.resolve() == path
    except (OSError, ValueError):  # a name that no file can have
        return False
