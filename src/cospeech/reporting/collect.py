"""Reading the records of many runs, and summing them up over seeds."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cospeech.errors import CospeechError, InputFileError
from cospeech.reporting.record import load_record
from cospeech.reporting.run_state import is_at_work
from cospeech.reporting.tables import Summary, summarise

RECORD = "record.json"
PROTOCOLS: tuple[str, ...] = ("windows", "recordings")
"""The two ways a run is judged; their numbers are not comparable with one another."""

_SPACE = ("corpus fingerprint", "encoder")
_MOST_SAMPLES = 100
_LONGEST_SETTING = 60
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
_CATALOGUE = "metrics.catalogue."
_SETTINGS_IN_A_LABEL = 3


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
            if key.startswith(_CATALOGUE):
                name = key.removeprefix(_CATALOGUE).partition(".")[0]
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
        space: Corpus fingerprint and encoder hash of its numbers.
        is_debug: Whether its runs are debug runs.
    """

    label: str
    model: str
    data: str
    ablation: str
    runs: list[Run] = field(default_factory=list)
    superseded: list[Run] = field(default_factory=list)
    unfinished: list[Run] = field(default_factory=list)
    space: tuple[str | None, str | None] = (None, None)
    is_debug: bool = False

    @property
    def members(self) -> list[Run]:
        """Every run, finished or not."""
        return [*self.runs, *self.superseded, *self.unfinished]

    def summary(self, protocol: str, metric: str) -> Summary | None:
        """A final metric over the seeds; None when no run has it."""
        values = (number(run.final(protocol).get(metric)) for run in self.runs)
        found = summarise(value for value in values if value is not None)
        return None if found is None else replace(found, of=len(self.runs))


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


def group_runs(runs: Iterable[Run]) -> list[Group]:
    """Runs by model, data, ablation and every setting, evaluation encoder and corpus they share.

    Numbers from different encoders or corpora are not comparable, so they never meet in a mean; nor
    do those of a metric with other settings. A metric that only some runs have sets none apart.
    """
    alike: dict[str, list[Run]] = {}
    for run in runs:
        names = [run.values.get(name) for name in ("model", "data", "ablation")]
        key = json.dumps([*names, run.is_debug, run.settings()], sort_keys=True, default=str)
        alike.setdefault(key, []).append(run)
    groups = [
        _group(members)
        for same in alike.values()
        for of_a_space in _comparable(same)
        for members in _judged_alike(of_a_space)
    ]
    _tell_apart(groups)
    return sorted(groups, key=lambda group: (group.data, group.model, group.ablation, group.label))


def _comparable(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs of equal settings, apart by corpus and encoder.

    A run that stopped before it knew its corpus or encoder joins the first.
    """
    known: dict[tuple[Any, Any], list[Run]] = {}
    early: list[Run] = []
    for run in runs:
        space = run.space
        if None in space and run.status != "ok":
            early.append(run)
        else:
            known.setdefault(space, []).append(run)
    spaces = list(known.values())
    if not spaces:
        return [early]
    spaces[0].extend(early)
    return spaces


def _judged_alike(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs apart by the settings of the metrics that they share; each joins the first it can."""
    found: list[tuple[dict[str, dict[str, Any]], list[Run]]] = []
    for run in runs:
        mine = run.metrics()
        for known, members in found:
            if all(known.get(name, settings) == settings for name, settings in mine.items()):
                known |= mine
                members.append(run)
                break
        else:
            found.append((mine, [run]))
    return [members for _, members in found]


def _group(members: Sequence[Run]) -> Group:
    first = members[0].values
    model, data, ablation = (str(first.get(name)) for name in ("model", "data", "ablation"))
    what = ablation.removeprefix(f"{model}__").replace("_", " ")
    label = model if ablation in ("full", "None") else f"{model}, {what}"
    group = Group(label, model, data, ablation, is_debug=members[0].is_debug)
    group.space = max((run.space for run in members), key=lambda space: 2 - space.count(None))
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
    alike: dict[tuple[str, str, bool], list[Group]] = {}
    for group in groups:
        alike.setdefault((group.label, group.data, group.is_debug), []).append(group)
    for same in alike.values():
        if len(same) < 2:
            continue
        runs = [group.members[0] for group in same]
        differing = {
            key: [str(value)[:_LONGEST_SETTING] for value in values]
            for key, values in differences(runs).items()
            if key in _SPACE
            or key.startswith(_CATALOGUE)
            or any(key in run.settings() for run in runs)
        }
        shown = _telling(differing)
        for i, group in enumerate(same):
            parts = [f"{key}={values[i]}" for key, values in differing.items() if key in shown]
            more = ", …" if any(key not in shown and key not in _SPACE for key in differing) else ""
            group.label = f"{group.label} [{', '.join(parts)}{more}]"


def _telling(differing: Mapping[str, Sequence[str]]) -> list[str]:
    """The keys that tell all apart, the most telling first, and further settings up to a few."""
    shown: list[str] = []
    left = list(differing)

    def told_apart(keys: Sequence[str]) -> int:
        return len(set(zip(*(differing[key] for key in keys), strict=True)))

    while left:
        best = max(left, key=lambda key: told_apart([*shown, key]))
        if shown and told_apart([*shown, best]) == told_apart(shown):
            break
        shown.append(best)
        left.remove(best)
    settings = [key for key in left if key not in _SPACE]
    return [*shown, *settings[: max(0, _SETTINGS_IN_A_LABEL - len(shown))]]


def differences(runs: Sequence[Run]) -> dict[str, list[Any]]:
    """What differs between runs: setting, corpus, encoder, commit or version -> value per run.

    Values stand in the order of ``runs``; None where a run does not have the key. Of the metrics,
    those count that all runs have.
    """
    shared = set[str]()
    if runs:
        shared = set.intersection(*(set(run.metrics()) for run in runs))
    flat = []
    for run in runs:
        facts = {
            "data": run.values.get("data"),
            "corpus fingerprint": _short(run.values.get("data_fingerprint")),
            "encoder": _short(run.mapping("encoder").get("sha256")),
            "commit": _short(run.values.get("commit")),
            "uncommitted changes": run.values.get("dirty"),
        }
        versions = {f"version of {name}": value for name, value in run.mapping("versions").items()}
        of_metrics = run.metrics()
        judged = {key: value for name in shared for key, value in of_metrics[name].items()}
        flat.append({**run.settings(), **dict(sorted(judged.items())), **facts, **versions})
    keys = dict.fromkeys(key for values in flat for key in values)
    table = {key: [values.get(key) for values in flat] for key in keys}
    return {key: values for key, values in table.items() if any(v != values[0] for v in values[1:])}


def _short(value: Any) -> str | None:
    return None if value is None else str(value)[:12]
