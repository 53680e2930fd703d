"""What the evaluation asks of a method, found before anything slow begins."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lightning import LightningModule

from cospeech.corpus.features.positions import evaluation_frames
from cospeech.corpus.window_loader import WindowReader
from cospeech.errors import ConfigError
from cospeech.evaluation import Catalogue, standard_catalogue
from cospeech.experiment.plain_arguments import argument_names
from cospeech.methods.base import GestureMethod
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES
from cospeech.quoting import setting

_OF_FGD = frozenset({"mean_term", "covariance_term"})
"""Values that a Fréchet gesture distance logs, whatever its name in the catalogue."""


def refuse_unjudgeable(name: str, method: LightningModule) -> None:
    """Refuse a method whose training would end in nothing that can be judged or loaded.

    Args:
        name: How it is chosen.
        method: It, of any corpus.

    Raises:
        ConfigError: It doesn't say which windows and fields it reads; its windows are shorter than
            those that motion is judged by; or its checkpoints lack arguments of its constructor.
    """
    kind = type(method)
    if not isinstance(method, WindowReader):
        raise ConfigError(
            f"model={name}: {kind.__name__} has no window or no needs",
            "say which windows it works on (a WindowSpec) and the names of the fields it reads",
        )
    if not isinstance(method, GestureMethod):
        return
    window = method.window.of_split("val")
    frames = evaluation_frames(window.frames, window.fps)
    if frames < EVALUATION_FRAMES:
        least = math.ceil((EVALUATION_FRAMES - 1) / EVALUATION_FPS * window.fps - 1e-6) + 1
        raise ConfigError(
            f"model={name}: its windows of {window.frames} frames at {window.fps:g} fps hold"
            f" {frames} frames at {EVALUATION_FPS:g} fps, and motion is judged in windows of"
            f" {EVALUATION_FRAMES}",
            f"give {kind.__name__} windows of {least} frames or more",
        )
    if unsaved := [each for each in argument_names(kind) if each not in method.hparams]:
        raise ConfigError(
            f"model={name}: checkpoints of {kind.__name__} would lack {', '.join(unsaved)}, and"
            " could not be loaded again",
            "let its constructor call self.save_hyperparameters()",
        )


def refuse_absent_monitors(
    monitors: Mapping[str, str], catalogue: Catalogue, method: GestureMethod
) -> None:
    """Refuse to choose checkpoints by a metric that has been taken out of the catalogue.

    What else a method logs, nobody knows before it has; so only metrics of the standard catalogue
    are missed.

    Args:
        monitors: Setting -> name of the logged value: ``{"training.monitor": "val/fgd"}``.
        catalogue: The metrics of the run.
        method: It, of any corpus.

    Raises:
        ConfigError: One is of a metric that the catalogue lacks, or the method makes a value of it.
    """
    absent = _logged(standard_catalogue()) - _logged(catalogue)
    for name in sorted(absent & method.derived_from):
        raise ConfigError(
            f"{type(method).__name__} makes values of its own of {name}, and metrics.catalogue has"
            " no such metric",
            f"keep it: leave metrics.catalogue.{_metric_of(name)} as it is",
        )
    for key, monitor in monitors.items():
        stage, _, name = monitor.partition("/")
        if stage != "val" or name not in absent:
            continue
        others = [
            other
            for other, metric in catalogue.metrics.items()
            if metric.higher_is_better is False and other in _logged(catalogue)
        ]
        instead = f", or watch another: {setting(key, f'val/{others[0]}')}" if others else ""
        raise ConfigError(
            f"{key}={monitor}: metrics.catalogue has no such metric",
            f"keep it: leave metrics.catalogue.{_metric_of(name)} as it is{instead}",
        )


def _logged(catalogue: Catalogue) -> set[str]:
    """Names under which an epoch's values are logged."""
    names = set[str]()
    for name, metric in catalogue.metrics.items():
        parts = _OF_FGD if isinstance(metric, FrechetGestureDistance) else metric.parts
        names |= {name, *(f"{name}_{part}" for part in parts)}
    return names


def _metric_of(value: str) -> str:
    return "fgd" if value.removeprefix("fgd_") in _OF_FGD else value
