"""How the metrics answer to known disturbances (Yoon et al. 2020, section 5.2 and figure 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor

from cospeech.errors import CospeechError
from cospeech.files import replacing
from cospeech.metrics import disturbances
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.functional import frechet_terms, joint_mae
from cospeech.metrics.moments import feature_moments

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVELS: dict[str, tuple[float, ...]] = {
    "gaussian": (0.0003, 0.001, 0.003),
    "salt_and_pepper": (0.03, 0.1, 0.2),
    "temporal": (1, 5, 10),
    "multiplicative": (0.0, 0.5, 1.5, 2.0),
    "mismatched": (0.2, 0.5, 1.0),
}
"""Disturbance -> levels of zeta.

The paper's text names gaussian 0.001, salt-and-pepper 0.1, temporal 5, multiplicative 0 and 2, and
mismatched 0.2 and 0.5; the levels around them, which only its figure shows, are ours. There are 16
of them, as many as the paper's user study counts (14, and two mismatched ones left out).
"""


class NoiseRow(NamedTuple):
    """One disturbance at one level.

    Attributes:
        disturbance: A key of `LEVELS`.
        zeta: Its level.
        fgd: Fréchet gesture distance to the undisturbed windows.
        mean_term: Its mean term.
        covariance_term: Its covariance term.
        joint_mae: Mean absolute difference of joint coordinates over all frames, metres.
    """

    disturbance: str
    zeta: float
    fgd: float
    mean_term: float
    covariance_term: float
    joint_mae: float


def run_noise_study(
    encoder: GestureEncoder,
    positions: Tensor,
    seed: int = 0,
    levels: Mapping[str, tuple[float, ...]] = LEVELS,
) -> list[NoiseRow]:
    """Disturb real windows and measure how far each disturbance takes them.

    Noise keeps the paper's ratio to bone length (see `cospeech.metrics.disturbances`). Each
    disturbance sees the same draws at all its levels, so a curve shows the level alone.

    Args:
        encoder: The frozen encoder.
        positions: ``(N, 34, 10, 3)`` real windows, metres; N should be well over 32.
        seed: Of all draws.
        levels: Disturbance -> levels of zeta.

    Returns:
        One row per disturbance and level, in the order of ``levels``.

    Raises:
        ValueError: An unknown disturbance.
    """
    scale = disturbances.published_scale(positions)
    mean_pose = positions.double().mean((0, 1)).float()
    disturb: dict[str, Callable[[float, torch.Generator], Tensor]] = {
        "gaussian": lambda zeta, draw: disturbances.gaussian(positions, zeta, scale, draw),
        "salt_and_pepper": lambda zeta, draw: disturbances.salt_and_pepper(
            positions, zeta, scale, draw
        ),
        "temporal": lambda zeta, draw: disturbances.temporal(positions, int(zeta), scale, draw),
        "multiplicative": lambda zeta, _: disturbances.multiplicative(positions, zeta, mean_pose),
        "mismatched": lambda zeta, draw: disturbances.mismatched(positions, zeta, draw),
    }
    unknown = sorted(set(levels) - set(disturb))
    if unknown:
        raise ValueError(f"unknown disturbances {unknown}; known are {sorted(disturb)}")
    real = feature_moments(encoder.encode_all(positions)).mean_and_covariance()
    rows = []
    for name, zetas in levels.items():
        for zeta in zetas:
            disturbed = disturb[name](zeta, torch.Generator().manual_seed(seed))
            features = encoder.encode_all(disturbed)
            terms = frechet_terms(*real, *feature_moments(features).mean_and_covariance())
            error = joint_mae(disturbed, positions, seed_frames=0)
            numbers = (terms.total, terms.mean_term, terms.covariance_term, error)
            rows.append(NoiseRow(name, zeta, *(number.item() for number in numbers)))
    return rows


_PANELS = {
    "gaussian": ("Gaussian", "variance ζ"),
    "salt_and_pepper": ("Salt & pepper", "probability ζ"),
    "temporal": ("Temporal", "frames ζ"),
    "multiplicative": ("Multiplicative", "factor ζ (1: undisturbed)"),
    "mismatched": ("Mismatched", "fraction ζ"),
}


def plot_noise_study(rows: list[NoiseRow], path: str | Path) -> None:
    """Draw the study as the paper's figure 4: FGD above, joint error below.

    Args:
        rows: What `run_noise_study` returned.
        path: Image file to write; its ending chooses the format.

    Raises:
        CospeechError: Matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise CospeechError(
            "plotting the noise study needs matplotlib", 'pip install "cospeech[plots]"'
        ) from error
    names = list(dict.fromkeys(row.disturbance for row in rows))
    by_name = {name: [row for row in rows if row.disturbance == name] for name in names}
    widths = [len(by_name[name]) for name in names]
    # A figure of its own, not pyplot's, leaves the caller's backend and open figures alone.
    figure = Figure(figsize=(1.2 + 0.72 * sum(widths), 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(
        2, len(names), sharex="col", sharey="row", squeeze=False, width_ratios=widths
    )
    for (upper, lower), name in zip(axes.T, names, strict=True):
        title, meaning = _PANELS[name]
        upper.set_title(title, fontsize=11)
        lower.set_xlabel(meaning, fontsize=10)
        zetas, fgds, mean_terms, covariance_terms, errors = zip(
            *(row[1:] for row in by_name[name]), strict=True
        )
        parts: list[tuple[str, str, Sequence[float]]] = [
            ("mean term", "#4c72b0", mean_terms),
            ("covariance term", "#9db7dd", covariance_terms),
        ]
        _bars(upper, zetas, parts, [f"{fgd:.3g}" for fgd in fgds])
        centimetres = [100 * error for error in errors]
        parts = [("joint MAE", "#dd8452", centimetres)]
        _bars(lower, zetas, parts, [f"{error:.3g}" for error in centimetres])
    axes[0, 0].set_ylabel("FGD (feature units²)")
    axes[1, 0].set_ylabel("joint MAE (cm)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False
    )
    figure.suptitle("Metrics under synthetic disturbances of real motion", x=0.01, ha="left")
    with replacing(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix.removeprefix("."), dpi=160)


def _bars(
    axis: Axes,
    zetas: Sequence[float],
    parts: list[tuple[str, str, Sequence[float]]],
    texts: list[str],
) -> None:
    """Stacked bars with a text on top of each stack."""
    places = range(len(zetas))
    tops = [0.0] * len(zetas)
    for label, colour, heights in parts:
        drawn = axis.bar(places, heights, bottom=tops, color=colour, label=label, width=0.7)
        tops = [top + height for top, height in zip(tops, heights, strict=True)]
    axis.bar_label(drawn, labels=texts, fontsize=8.5, padding=2)
    axis.set_xticks(places, [f"{zeta:g}" for zeta in zetas])
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="y", alpha=0.3)
    axis.set_axisbelow(True)
    axis.margins(y=0.12)
