"""The windows protocol: every epoch, the windows that the method samples against the real ones."""

from __future__ import annotations

from typing import assert_never

import torch
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.features import FIELDS
from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.evaluation.catalogue import Catalogue
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import EvaluationWindows, cut_windows
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES, EVALUATION_STRIDE
from cospeech.speech.speech import SAMPLE_RATE


class EpochEvaluation:
    """The metrics over the windows of one epoch; a window is cut into those of the evaluation.

    Args:
        catalogue: The metrics.
        encoder: The evaluation space.
        window: The method's windows.
        device: Where they are.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        encoder: GestureEncoder,
        window: WindowSpec,
        device: torch.device,
    ) -> None:
        self._measurement = catalogue.fresh().to(device)
        self._encoder = encoder.to(device)
        self._window, self._needs = window, catalogue.needs

    @torch.no_grad()
    def update(self, positions: Tensor, batch: GestureBatch) -> None:
        """Add a batch.

        Args:
            positions: ``(B, E, 10, 3)`` what the method makes of it, at the evaluation rate.
            batch: The batch, with ``positions`` and what the metrics read.

        Raises:
            CospeechError: A position is NaN or infinite, or there are others than in the batch.
        """
        recorded = batch.require("positions")
        if positions.shape != recorded.shape:
            raise CospeechError(
                f"the method samples {tuple(positions.shape)} where its windows hold positions"
                f" {tuple(recorded.shape)}, at 15 fps",
                "sample gives evaluation frames: cospeech.corpus.features.positions has"
                " at_evaluation_rate",
            )
        cut = cut_windows(positions)
        if not cut.isfinite().all():
            raise CospeechError(
                "the method generates NaN or infinite positions: its weights are damaged",
                "look at the losses of the last epochs; the last checkpoint may still be good",
            )
        per_item = len(cut) // max(1, len(recorded))
        fields = {
            name: cut_field(name, batch.require(name), self._window, per_item)
            for name in self._needs
        }
        real = cut_windows(recorded)
        of_real = EvaluationWindows(real, self._encoder.encode_positions(real), fields)
        made = of_real.moving(cut, self._encoder.encode_positions(cut))
        self._measurement.update(made, of_real)

    def compute(self) -> dict[str, Tensor]:
        """The metrics' values by name, over all processes."""
        return self._measurement.compute()


def cut_field(name: str, values: Tensor, window: WindowSpec, per_item: int) -> Tensor:
    """A batch's field over the windows of the evaluation.

    Args:
        name: Of the field.
        values: ``(B, ...)`` as the method's batch has it.
        window: The method's windows.
        per_item: How many windows of the evaluation are in each.

    Returns:
        ``(B per_item, ...)``, as `EvaluationWindows.fields` describes it; sound that a last window
        lacks is silence.
    """
    field = FIELDS[name]
    firsts = EVALUATION_STRIDE * torch.arange(per_item, device=values.device)
    match field.axis:
        case "evaluation frames":
            return cut_windows(values)
        case "none":
            return values.repeat_interleave(per_item, dim=0)
        case "samples":
            length = round(EVALUATION_FRAMES / EVALUATION_FPS * SAMPLE_RATE)
            starts = (firsts / EVALUATION_FPS * SAMPLE_RATE).round().long()
            at = starts[:, None] + torch.arange(length, device=values.device)
            lacking = max(0, int(at.max()) + 1 - values.shape[1])
            values = torch.nn.functional.pad(values, (0, lacking))
        case "method frames":
            frames = firsts[:, None] + torch.arange(EVALUATION_FRAMES, device=values.device)
            at = (frames / EVALUATION_FPS * window.fps).round().long()
            at = at.clamp(max=window.frames - 1)
            at = at + (window.past if isinstance(field, SpeechField) else 0)
        case _:
            assert_never(field.axis)
    return values[:, at].flatten(0, 1)
