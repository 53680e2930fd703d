"""Reading the records of many runs, and summing them up over seeds."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cospeech.errors import CospeechError
from cospeech.reporting.tables import METRICS, Column, Summary, summarise

PROTOCOLS: tuple[str, ...] = ("windows", "recordings")
"""The two ways a run is judged; their numbers are not comparable with one another."""

_MAX_RECORD_BYTES = 64 * 2**20
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
)


@dataclass(frozen=True, eq=False)
class Run:
    """One record.

    Attributes:
        folder: The run's folder.
        values: Content of its ``record.json``.
    """

    folder: Path
    values: Mapping[str, Any]

    @property
    def id(self) -> str:
        """The run's id, or its folder's name."""
        return str(self.values.get("id") or self.folder.name)

    @property
    def status(self) -> str:
        """``ok``, ``failed``, ``interrupted``, ``running`` or ``unknown``."""
        return str(self.values.get("status") or "unknown")

    @property
    def seed(self) -> Any:
        """The run's seed; None when not recorded."""
        return self.values.get("seed")

    def mapping(self, key: str) -> Mapping[str, Any]:
        """A top-level object of the record; empty when absent or of another type."""
        value = self.values.get(key)
        return value if isinstance(value, Mapping) else {}

    def final(self, protocol: str) -> Mapping[str, Any]:
        """Final metrics under a protocol."""
        value = self.mapping("final").get(protocol)
        return value if isinstance(value, Mapping) else {}

    def epochs(self) -> list[Mapping[str, Any]]:
        """Metrics per epoch, in order."""
        rows = self.values.get("epochs")
        if not isinstance(rows, list):
            return []
        known = [r for r in rows if isinstance(r, Mapping) and number(r.get("epoch")) is not None]
        return sorted(known, key=lambda row: float(row["epoch"]))

    def samples(self) -> list[Path]:
        """The run's player pages and videos that exist, inside its folder."""
        names = self.values.get("samples")
        paths = [self.folder / str(name) for name in names] if isinstance(names, list) else []
        root = self.folder.resolve()
        return [path for path in paths if path.is_file() and root in path.resolve().parents]

    def settings(self) -> dict[str, Any]:
        """The resolved config as dotted keys, without what names or watches the run."""
        flat = flatten(self.mapping("config"))
        return {
            key: value
            for key, value in flat.items()
            if key.split(".")[0] not in _NOT_SETTINGS
            and not (key.rsplit(".", 1)[-1] == "seed" and value == self.seed)
            and not (isinstance(value, str) and self.id in value)
        }


@dataclass(frozen=True, eq=False)
class Collection:
    """The records under a folder.

    Attributes:
        folder: Where they were looked for.
        runs: Readable records, by folder name.
        damaged: File and reason of each that could not be read.
    """

    folder: Path
    runs: list[Run]
    damaged: list[tuple[Path, str]]


@dataclass(eq=False)
class Group:
    """Runs that differ in their seed alone.

    Attributes:
        label: Model and ablation, with what else sets the group apart from the others.
        model: Model.
        data: Data.
        ablation: Ablation.
        runs: The newest finished run of each seed.
        superseded: Finished runs of a seed that a newer one repeats.
        unfinished: Failed, interrupted and running ones.
    """

    label: str
    model: str
    data: str
    ablation: str
    runs: list[Run] = field(default_factory=list)
    superseded: list[Run] = field(default_factory=list)
    unfinished: list[Run] = field(default_factory=list)

    @property
    def members(self) -> list[Run]:
        """Every run, finished or not."""
        return [*self.runs, *self.superseded, *self.unfinished]

    def summary(self, protocol: str, metric: str) -> Summary | None:
        """A final metric over the seeds; None when no run has it."""
        values = (number(run.final(protocol).get(metric)) for run in self.runs)
        return summarise(value for value in values if value is not None)

    def row(self, protocol: str) -> dict[str, Any]:
        """The group's row of a results table."""
        summaries = {metric.key: self.summary(protocol, metric.key) for metric in METRICS}
        return {"label": self.label, "data": self.data, "runs": len(self.runs), **summaries}


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
    """Read every ``record.json`` under a folder.

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
    for path in sorted(folder.rglob("record.json")):
        try:
            runs.append(Run(path.parent, _read(path)))
        except (OSError, ValueError, RecursionError) as error:
            damaged.append((path, str(error) or type(error).__name__))
    if not runs and not damaged:
        raise CospeechError(f"{folder}: no record.json under it", "train something first: train.py")
    return Collection(folder, runs, damaged)


def _read(path: Path) -> dict[str, Any]:
    size = path.stat().st_size
    if size > _MAX_RECORD_BYTES:
        raise ValueError(f"{size} bytes is no record")
    values = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(values, dict):
        raise ValueError(f"holds a {type(values).__name__}, not an object")
    return values


def group_runs(runs: Iterable[Run]) -> list[Group]:
    """Runs by model, data, ablation and every setting, evaluation encoder and corpus they share.

    Numbers from different encoders or corpora are not comparable, so they never meet in a mean.
    """
    alike: dict[str, list[Run]] = {}
    for run in runs:
        names = [run.values.get(name) for name in ("model", "data", "ablation")]
        key = json.dumps([*names, run.settings()], sort_keys=True, default=str)
        alike.setdefault(key, []).append(run)
    groups = [_group(members) for same in alike.values() for members in _comparable(same)]
    _tell_apart(groups)
    return sorted(groups, key=lambda group: (group.data, group.model, group.ablation, group.label))


def _comparable(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs of equal settings, apart by corpus and encoder.

    A run that stopped before it knew its corpus or encoder joins the first.
    """
    known: dict[tuple[Any, Any], list[Run]] = {}
    early: list[Run] = []
    for run in runs:
        space = run.values.get("data_fingerprint"), run.mapping("encoder").get("sha256")
        if None in space and run.status != "ok":
            early.append(run)
        else:
            known.setdefault(space, []).append(run)
    spaces = list(known.values())
    if not spaces:
        return [early]
    spaces[0].extend(early)
    return spaces


def _group(members: Sequence[Run]) -> Group:
    first = members[0].values
    model, data, ablation = (str(first.get(name)) for name in ("model", "data", "ablation"))
    what = ablation.removeprefix(f"{model}__").replace("_", " ")
    label = model if ablation in ("full", "None") else f"{model}, {what}"
    group = Group(label, model, data, ablation)
    for run in sorted(members, key=lambda run: str(run.values.get("finished") or ""), reverse=True):
        if run.status != "ok":
            group.unfinished.append(run)
        elif any(run.seed == newer.seed for newer in group.runs):
            group.superseded.append(run)
        else:
            group.runs.append(run)
    group.runs.sort(key=lambda run: str(run.seed))
    return group


def _tell_apart(groups: Sequence[Group]) -> None:
    """Add the settings that differ to the labels of groups that would look alike."""
    alike: dict[tuple[str, str], list[Group]] = {}
    for group in groups:
        alike.setdefault((group.label, group.data), []).append(group)
    for same in alike.values():
        if len(same) < 2:
            continue
        differing = differences([group.members[0] for group in same])
        for i, group in enumerate(same):
            parts = [f"{key}={values[i]}" for key, values in differing.items()]
            group.label = f"{group.label} [{', '.join(parts[:3])}{', …' if len(parts) > 3 else ''}]"


def differences(runs: Sequence[Run]) -> dict[str, list[Any]]:
    """What differs between runs: setting, corpus, encoder, commit or version -> value per run.

    Values stand in the order of ``runs``; None where a run does not have the key.
    """
    flat = []
    for run in runs:
        facts = {
            "corpus fingerprint": _short(run.values.get("data_fingerprint")),
            "encoder": _short(run.mapping("encoder").get("sha256")),
            "commit": _short(run.values.get("commit")),
            "uncommitted changes": run.values.get("dirty"),
        }
        versions = {f"version of {name}": value for name, value in run.mapping("versions").items()}
        flat.append({**run.settings(), **facts, **versions})
    keys = dict.fromkeys(key for values in flat for key in values)
    table = {key: [values.get(key) for values in flat] for key in keys}
    return {key: values for key, values in table.items() if any(v != values[0] for v in values[1:])}


def _short(value: Any) -> str | None:
    return None if value is None else str(value)[:12]


def result_columns(rows: Sequence[Mapping[str, Any]]) -> list[Column]:
    """The columns of a results table that some row has a value for."""
    metrics = [column for column in METRICS if any(row.get(column.key) is not None for row in rows)]
    several = len({row.get("data") for row in rows if row.get("data") is not None}) > 1
    data = [Column("data")] if several else []
    return [Column("label", " "), *data, Column("runs"), *metrics]
