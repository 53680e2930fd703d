"""Runs of the same settings together, over their seeds, and what sets others apart."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from cospeech.reporting.collect import CATALOGUE, Run, number
from cospeech.reporting.tables import Summary, summarise

_SPACE = ("corpus fingerprint", "encoder")
_LONGEST_SETTING = 60
_SETTINGS_IN_A_LABEL = 3


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
            or key.startswith(CATALOGUE)
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
