"""The windows protocol: every epoch, the windows that the method samples against the real ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.features.positions import evaluation_frames
from cospeech.corpus.windows import ServesWindows, WindowDataset
from cospeech.errors import CospeechError
from cospeech.evaluation.catalogue import Catalogue
from cospeech.evaluation.real_windows import evaluation_windows
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import EvaluationWindows, cut_windows
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES, EVALUATION_STRIDE


class EvaluationFields:
    """What metrics read of the windows of the evaluation that a method's windows are cut into.

    They are read from the corpus at the evaluation's own frames, as for a recording: a method's
    frames at another rate don't say when in a frame a word begins, nor hold two words of one.

    Args:
        windows: The method's windows; of one that begins between two of the evaluation's frames,
            the nearer one is taken.
        needs: Fields of the corpus.
    """

    def __init__(self, windows: ServesWindows, needs: frozenset[str]) -> None:
        self._served: WindowDataset | None = None
        frames = evaluation_frames(windows.spec.frames, windows.spec.fps)
        firsts = np.arange(0, frames - EVALUATION_FRAMES + 1, EVALUATION_STRIDE)
        self._per_window = len(firsts)
        if not needs or not len(firsts):
            return
        tracks = windows.tracks
        starts = np.rint(windows.starts_s * EVALUATION_FPS).astype(np.int64)
        within = starts - tracks.starts[windows.sequences]
        spans = tracks.span_of[windows.sequences].repeat(self._per_window)
        places = np.stack([spans, (within[:, None] + firsts).reshape(-1)], axis=1)
        self._served = evaluation_windows(windows.store, windows.split, tracks.spans, places, needs)

    def of(self, window_ids: Tensor) -> Mapping[str, Tensor]:
        """Fields of some of the method's windows, as `EvaluationWindows.fields` describes them.

        Args:
            window_ids: ``(B,)`` of a batch.
        """
        if self._served is None:
            return {}
        cut = window_ids.cpu()[:, None] * self._per_window + torch.arange(self._per_window)
        batch = self._served.batch(cut.flatten().numpy())
        return batch.to(window_ids.device).fields


class EpochEvaluation:
    """The metrics over the windows of one epoch; a window is cut into those of the evaluation.

    Args:
        catalogue: The metrics.
        encoder: The evaluation space.
        fields: What was said in the method's windows.
        device: Where they are.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        encoder: GestureEncoder,
        fields: EvaluationFields,
        device: torch.device,
    ) -> None:
        self._measurement = catalogue.fresh().to(device)
        self._encoder = encoder.to(device)
        self._fields = fields

    @torch.no_grad()
    def update(self, positions: Tensor, batch: GestureBatch) -> None:
        """Add a batch.

        Args:
            positions: ``(B, E, 10, 3)`` what the method makes of it, at the evaluation rate.
            batch: The batch, with ``positions``.

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
        real = cut_windows(recorded)
        said = self._fields.of(batch.window_ids)
        of_real = EvaluationWindows(real, self._encoder.encode_positions(real), said)
        made = of_real.moving(cut, self._encoder.encode_positions(cut))
        self._measurement.update(made, of_real)

    def compute(self) -> dict[str, Tensor]:
        """The metrics' values by name, over all processes."""
        return self._measurement.compute()
