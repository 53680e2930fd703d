"""Distance of paired windows in the encoder's feature space."""

from __future__ import annotations

from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import feature_distance
from cospeech.metrics.window_metric import MeanOverWindows


class FeatureDistance(MeanOverWindows):
    """Mean L1 distance, summed over dimensions, of paired windows' features.

    See docs/facts/trimodal.md, section 4.2.

    Unlike the Fréchet distance it asks for *this* window's motion, so it sees mismatched speech.
    In the encoder's own unit.
    """

    title = "feature distance"
    higher_is_better = False
    plot_lower_bound = 0.0

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `feature_distance`."""
        return feature_distance(generated.features, real.features)
