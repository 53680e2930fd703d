"""Disturbs real motion and looks at what metrics make of it, over a prepared corpus."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cospeech.corpus.store import Store
from cospeech.evaluation import real_windows
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.noise_study import NoiseRow, run_noise_study
from cospeech.reporting.charts import chart_style, colour, new_figure, save_picture
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import format_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANELS = {
    "gaussian": ("Gaussian", "variance ζ"),
    "salt_and_pepper": ("Salt & pepper", "probability ζ"),
    "temporal": ("Temporal", "frames ζ"),
    "multiplicative": ("Multiplicative", "factor ζ (1: undisturbed)"),
    "mismatched": ("Mismatched", "fraction ζ"),
}


def fgd_noise(
    store: Store, encoder: GestureEncoder, split: str, folder: Path, seed: int
) -> dict[str, list[dict[str, object]]]:
    """What known disturbances do to FGD and to joint error (Yoon et al. 2020, section 5.2).

    Prints the table and writes ``fgd_noise.json`` and ``fgd_noise.png`` (the paper's figure 4).

    Args:
        store: The corpus.
        encoder: The evaluation space.
        split: The split whose windows are disturbed.
        folder: Where the files go.
        seed: Of all draws.
    """
    positions, _ = real_windows(store, store.splits[split])
    rows = run_noise_study(encoder, positions, seed)
    values = [dict(row._asdict()) for row in rows]
    result: dict[str, list[dict[str, object]]] = {"rows": values}
    write_json(
        folder / "fgd_noise.json",
        {
            "corpus": store.name,
            "fingerprint": store.fingerprint,
            "split": split,
            "windows": len(positions),
            "encoder": {"sha256": encoder.sha256, "source": encoder.source},
            **result,
        },
    )
    print(format_table([{**row, "zeta": f"{row['zeta']:g}"} for row in values]))
    picture = folder / "fgd_noise.png"
    plot_noise_study(rows, picture)
    print(f"\n{len(positions)} {split} windows of {store.name}; figure: {picture}")
    return result


@chart_style()
def plot_noise_study(rows: Sequence[NoiseRow], path: Path) -> None:
    """Draw the study as the paper's figure 4: FGD above, joint error below.

    Args:
        rows: What `run_noise_study` returned.
        path: Image file to write; its ending chooses the format.
    """
    names = list(dict.fromkeys(row.disturbance for row in rows))
    by_name = {name: [row for row in rows if row.disturbance == name] for name in names}
    widths = [len(by_name[name]) for name in names]
    figure = new_figure(86 + 52 * sum(widths), 374, "constrained")
    axes = figure.subplots(
        2, len(names), sharex="col", sharey="row", squeeze=False, width_ratios=widths
    )
    for (upper, lower), name in zip(axes.T, names, strict=True):
        title, meaning = _PANELS[name]
        upper.set_title(title, loc="center")
        lower.set_xlabel(meaning)
        zetas, fgds, mean_terms, covariance_terms, errors = zip(
            *(row[1:] for row in by_name[name]), strict=True
        )
        parts: list[tuple[str, str, Sequence[float]]] = [
            ("mean term", colour("c1"), mean_terms),
            ("covariance term", colour("c6"), covariance_terms),
        ]
        _bars(upper, zetas, parts, [f"{fgd:.3g}" for fgd in fgds])
        centimetres = [100 * error for error in errors]
        parts = [("joint MAE", colour("c2"), centimetres)]
        _bars(lower, zetas, parts, [f"{error:.3g}" for error in centimetres])
    axes[0, 0].set_ylabel("FGD (feature units²)")
    axes[1, 0].set_ylabel("joint MAE (cm)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False
    )
    figure.suptitle("Metrics under synthetic disturbances of real motion", x=0.01, ha="left")
    save_picture(figure, path)


def _bars(
    axis: Axes,
    zetas: Sequence[float],
    parts: list[tuple[str, str, Sequence[float]]],
    texts: list[str],
) -> None:
    """Stacked bars with a text on top of each stack."""
    places = range(len(zetas))
    tops = [0.0] * len(zetas)
    for label, ink, heights in parts:
        drawn = axis.bar(places, heights, bottom=tops, color=ink, label=label, width=0.7)
        tops = [top + height for top, height in zip(tops, heights, strict=True)]
    axis.bar_label(drawn, labels=texts, fontsize=8.5, padding=2)
    axis.set_xticks(places, [f"{zeta:g}" for zeta in zetas])
    axis.grid(axis="y")
    axis.margins(x=0.04, y=0.12)
