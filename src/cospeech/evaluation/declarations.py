"""What a metric must say of itself before anything is measured by it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

from cospeech.corpus.features import FIELDS
from cospeech.errors import ConfigError, one_line
from cospeech.metrics.window_metric import Comparison, WindowMetric

RESERVED = frozenset(
    {"windows", "windows_real", "recordings", "fgd_low", "fgd_high", "fgd_extrapolated"}
    | {"interval", "row", "label", "epoch"}
)
"""What stands in a row beside the metrics' values."""

MOST_CHARACTERS = 100
"""Of a heading and of a unit."""


def refuse_undeclared(metrics: Mapping[str, object]) -> None:
    """Refuse what could not be measured by, or not be told apart from something else.

    Args:
        metrics: Name -> what is named so.

    Raises:
        ConfigError: Something is no `WindowMetric`; its title, unit, direction, comparison or needs
            are none; or two values would have one name.
    """
    owners = dict.fromkeys(RESERVED, "the evaluation")
    for name, metric in metrics.items():
        where = f"metrics.catalogue.{name}"
        if not isinstance(metric, WindowMetric):
            raise ConfigError(
                f"{where} is a {type(metric).__name__}, no metric of windows",
                "derive its class from cospeech.metrics.window_metric.WindowMetric",
            )
        for problem, hint in _problems(metric):
            raise ConfigError(f"{where}: {type(metric).__name__} {problem}", hint)
        if not name.isidentifier():
            raise ConfigError(f"{where} is no name", "use letters, digits and underscores")
        for value in (name, *(f"{name}_{part}" for part in metric.parts)):
            if value in owners:
                raise ConfigError(
                    f"{where} has a value {value!r}, and so has {owners[value]}",
                    "give the metric another name",
                )
            owners[value] = where


def _problems(metric: WindowMetric) -> list[tuple[str, str]]:
    """What is wrong with a declaration, and what to do."""
    found = []
    for title in (getattr(metric, "title", None), *metric.parts.values()):
        if not _is_text(title) or not title:
            what = f"title = 'what stands above its column', up to {MOST_CHARACTERS} characters"
            found.append((f"has no title in one line: {title!r:.80}", what))
    if not _is_text(metric.unit):
        found.append((f"has a unit that isn't text: {metric.unit!r:.80}", "unit = 'm', or ''"))
    if metric.higher_is_better not in (True, False, None):
        found.append(("doesn't say which is better", "higher_is_better = True, False or None"))
    if metric.compares not in get_args(Comparison):
        choices = ", ".join(map(repr, get_args(Comparison)))
        found.append((f"compares {metric.compares!r:.80}", f"compares = one of {choices}"))
    if not isinstance(metric.needs, (set, frozenset)):
        found.append(("has needs that are no set of names", "needs = frozenset({'audio'})"))
        return found
    served = sorted(name for name, field in FIELDS.items() if field.reads != "search")
    if unknown := sorted({str(need) for need in metric.needs} - set(served)):
        found.append((f"needs {', '.join(unknown)}", f"a corpus has {', '.join(served)}"))
    return found


def _is_text(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MOST_CHARACTERS and one_line(value) == value
