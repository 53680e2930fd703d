"""What the evaluation asks of a method, found before anything slow begins."""

from __future__ import annotations

import math

from lightning import LightningModule

from cospeech.corpus.features.positions import evaluation_frames
from cospeech.corpus.window_loader import WindowReader
from cospeech.errors import ConfigError
from cospeech.experiment.plain_arguments import argument_names
from cospeech.methods.base import GestureMethod
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES


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
