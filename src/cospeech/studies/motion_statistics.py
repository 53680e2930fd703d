"""Table 3 and figure 4 of Kucherenko et al. 2020 for any runs: how strongly motion is moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.evaluation import generated_motions, long_enough
from cospeech.metrics.functional import joint_mae, position_error, root_mean_square_error
from cospeech.metrics.movement import derivative_sizes, histogram
from cospeech.motion.motion import resample_positions
from cospeech.motion.upper_body import EVALUATION_FPS, MOVING_JOINTS, UPPER_BODY
from cospeech.reporting.charts import SERIES, chart_style, colour, new_figure, save_picture
from cospeech.reporting.markup import one_line
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import Column, format_table, format_value, summarise
from cospeech.studies.trained_system import TrainedSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RECORDED = "recorded"
BINS = 40
_ORDERS = {"speed": 1, "acceleration": 2, "jerk": 3}
_WIDTHS = {"speed": 0.05, "acceleration": 0.5}
_UNITS = {"speed": "m/s", "acceleration": "m/s²", "jerk": "m/s³"}
_WRISTS = [MOVING_JOINTS.index(UPPER_BODY.index[f"{side}_wrist"]) for side in ("left", "right")]
_COLUMNS = (
    Column("system", " "),
    *(Column(name, f"{name}, {unit}") for name, unit in _UNITS.items()),
    *(
        Column(f"{name}_per_frame", f"{name}, {unit.replace('m/s', 'cm/frame')}")
        for name, unit in _UNITS.items()
    ),
    Column("rmse", "RMSE, cm"),
    Column("position_error", "APE, cm"),
    Column("joint_mae", "MAE, cm"),
)


@dataclass(frozen=True, eq=False)
class SystemStatistics:
    """A system in numbers, over the nine joints that can move.

    Attributes:
        per_recording: Name -> a value per recording: ``speed``, ``acceleration`` and ``jerk`` in
            metres and seconds, the same ``_per_frame`` in centimetres and frames at 15 fps, and of
            generated motion ``rmse``, ``position_error`` and ``joint_mae`` in centimetres.
        histograms: ``speed`` and ``acceleration`` of the wrists -> `BINS` + 1 counts, of which the
            last is of what is beyond.
        seeds: Trainings that the values are of, one after another.
    """

    per_recording: Mapping[str, Sequence[float]]
    histograms: Mapping[str, NDArray[np.int64]]
    seeds: int = 1

    def by_seed(self, name: str) -> list[float]:
        """The mean over recordings of each training."""
        means = np.reshape(self.per_recording[name], (self.seeds, -1)).mean(axis=1)
        return [float(mean) for mean in means]


def motion_statistics(
    store: Store,
    systems: Sequence[TrainedSystem],
    split: str,
    folder: Path,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Measure how strongly runs' motion is moved, beside recorded motion of the same speech.

    The motion is that of the recordings protocol. Prints a table of means and standard deviations
    over recordings, of several seeds another with 95 % of their mean, and writes
    ``motion_statistics.json`` and ``motion_statistics.png``: histograms of the wrists' speed and
    acceleration, with what is beyond the last bin.

    Args:
        store: The corpus of the runs.
        systems: The runs; those of one name are one system.
        split: The part to judge on.
        folder: Where the files go.
        about: What else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: No recording of the split has sound and the length of an evaluation window.
    """
    spans = store.spans_with_sound(long_enough(store, split), f"{split} recordings")
    if not spans:
        raise CospeechError(
            f"{store.name}: no {split} recording has sound and is as long as a window",
            "raise data.val_share and data.test_share, or choose another split",
        )
    recorded = [_moving(store.upper_body_motion(span).positions) for span in spans]
    motions = {RECORDED: (recorded, recorded)}
    for system in sorted(systems, key=lambda one: (one.name, one.seed)):
        made, real = motions.setdefault(system.name, ([], []))
        title = f"generating {split} recordings with {system.name}, seed {system.seed}"
        for motion, own in zip(
            generated_motions(system.method, store, spans, title), recorded, strict=True
        ):
            positions = resample_positions(motion.positions, motion.fps, EVALUATION_FPS)
            frames = min(len(own), len(positions))
            made.append(_moving(positions[:frames]))
            real.append(own[:frames])
    measured = {
        name: measure_motion(made, None if name == RECORDED else real, len(made) // len(spans))
        for name, (made, real) in motions.items()
    }
    result: dict[str, Any] = {
        **dict(about),
        "corpus": store.name,
        "fingerprint": store.fingerprint,
        "split": split,
        "fps": EVALUATION_FPS,
        "joints": [UPPER_BODY.joints[joint] for joint in MOVING_JOINTS],
        "histograms_of": [UPPER_BODY.joints[MOVING_JOINTS[joint]] for joint in _WRISTS],
        "bin_widths": _WIDTHS,
        "systems": {
            name: {
                "per_recording": dict(system.per_recording),
                "by_seed": {key: system.by_seed(key) for key in system.per_recording},
                "histograms": {key: h.tolist() for key, h in system.histograms.items()},
            }
            for name, system in measured.items()
        },
    }
    write_json(folder / "motion_statistics.json", result)
    picture = folder / "motion_statistics.png"
    plot_motion_statistics(measured, f"{store.name}, {split}", picture)
    print(statistics_table(measured))
    if any(system.seeds > 1 for system in measured.values()):
        print(f"\n{seeds_table(measured)}")
    print(f"\n{len(spans)} {split} recordings of {store.name} at 15 fps; figure: {picture}")
    return result


def _moving(positions: NDArray[np.floating]) -> NDArray[np.floating]:
    return positions[:, list(MOVING_JOINTS)]


def measure_motion(
    recordings: Sequence[NDArray[np.floating]],
    real: Sequence[NDArray[np.floating]] | None = None,
    seeds: int = 1,
) -> SystemStatistics:
    """Measure a system's motion.

    Args:
        recordings: ``(T, 9, 3)`` each, metres, at 15 fps.
        real: What was recorded with the same speech, of the same lengths; None for that itself.
        seeds: Trainings that the recordings are of, one after another.
    """
    values: dict[str, list[float]] = {column.key: [] for column in _COLUMNS[1:]}
    histograms = {name: np.zeros(BINS + 1, dtype=np.int64) for name in _WIDTHS}
    for number, positions in enumerate(recordings):
        for name, order in _ORDERS.items():
            sizes = derivative_sizes(positions, order, EVALUATION_FPS)
            per_frame = 100 * derivative_sizes(positions, order, 1)
            values[name].append(float(sizes.mean()))
            values[f"{name}_per_frame"].append(float(per_frame.mean()))
            if name in _WIDTHS:
                counts = histogram(sizes[:, _WRISTS], _WIDTHS[name], BINS)
                histograms[name] += counts.sum(axis=1)
        if real is None:
            continue
        made, was = (torch.from_numpy(side)[None] for side in (positions, real[number]))
        errors = {
            "rmse": root_mean_square_error(made, was, seed_frames=0),
            "position_error": position_error(made, was, seed_frames=0),
            "joint_mae": joint_mae(made, was, seed_frames=0),
        }
        for name, error in errors.items():
            values[name].append(100 * error.item())
    measured = {name: each for name, each in values.items() if each}
    return SystemStatistics(measured, histograms, seeds)


def statistics_table(systems: Mapping[str, SystemStatistics]) -> str:
    """Means and standard deviations over recordings, a row per system."""
    rows = [
        {"system": name} | {key: summarise(values) for key, values in system.per_recording.items()}
        for name, system in systems.items()
    ]
    return format_table(rows, _COLUMNS)


def seeds_table(systems: Mapping[str, SystemStatistics]) -> str:
    """Means over seeds and their 95 % intervals by Student's t, a row per system of several."""
    rows = [
        {"system": name, "seeds": system.seeds}
        | {key: _with_interval(system.by_seed(key)) for key in system.per_recording}
        for name, system in systems.items()
        if system.seeds > 1
    ]
    heading = Column("system", "95 % of the mean over seeds")
    return format_table(rows, (heading, Column("seeds", "seeds"), *_COLUMNS[1:]))


def _with_interval(values: Sequence[float]) -> str:
    summary = summarise(values)
    if summary is None or summary.ci95 is None:
        return format_value(None)
    return f"{summary.mean:.3g} ({summary.ci95[0]:.3g} to {summary.ci95[1]:.3g})"


@chart_style()
def plot_motion_statistics(
    systems: Mapping[str, SystemStatistics], corpus: str, path: Path
) -> None:
    """Draw how often the wrists have which speed and which acceleration.

    Args:
        systems: Recorded motion first.
        corpus: Name of the corpus and the part, for the title.
        path: Image file to write; its ending chooses the format.
    """
    figure = new_figure(900, 330, "constrained")
    for axes, name in zip(figure.subplots(1, 2), _WIDTHS, strict=True):
        counts = {key: system.histograms[name] for key, system in systems.items()}
        _shares(axes, counts, _WIDTHS[name])
        axes.set_xlabel(f"{name} of the wrists, {_UNITS[name]}")
    figure.axes[0].set_ylabel("share of frames, logarithmic")
    figure.axes[1].legend(loc="upper right")
    figure.suptitle(f"How strongly the wrists move on {one_line(corpus)}", x=0.01, ha="left")
    save_picture(figure, path)


def _shares(axes: Axes, counts: Mapping[str, NDArray[np.int64]], width: float) -> None:
    """Steps of the bins and, apart from them, a bar of what is beyond."""
    last = BINS * width
    beyond = np.linspace(1.04 * last, 1.12 * last, len(counts) + 1)
    for place, (name, each) in enumerate(counts.items()):
        ink = colour(("c0", *SERIES)[place % (len(SERIES) + 1)])
        shares = each / each.sum()
        axes.stairs(shares[:-1], width * np.arange(BINS + 1), baseline=None, color=ink, label=name)
        axes.stairs(shares[-1:], beyond[place : place + 2], color=ink, fill=True)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    ticks = last * np.arange(0, 1, 0.25)
    axes.set_xticks([*ticks, beyond.mean()], [*(f"{tick:g}" for tick in ticks), f"≥ {last:g}"])
    axes.grid(axis="y")
