"""Controls put to the test on held-out speech: measured, drawn, written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.corpus.store import Store
from cospeech.files import write_text
from cospeech.matching.control import QUANTITIES
from cospeech.matching.search import MatchingSearch
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import MakesStages
from cospeech.reporting.markup import markdown
from cospeech.reporting.record import write_json
from cospeech.studies.control_adherence.measuring import (
    Adherence,
    Change,
    Windows,
    count_windows,
    measure_adherence,
    measure_change,
    thresholds,
)
from cospeech.studies.control_adherence.motions import (
    CHANGING,
    FREE,
    Made,
    make_motions,
)
from cospeech.studies.control_adherence.picture import SHOWN_S, Panel, plot_adherence
from cospeech.studies.control_adherence.tables import (
    adherence_table,
    change_table,
    unit_of,
    windows_text,
)
from cospeech.studies.control_adherence.tested_controls import (
    CHANGING_PERCENTS,
    CHANGING_QUANTITIES,
    FAST_AND_HIGH,
    SLOW_AND_LOW,
    TESTED_CONTROLS,
)


def control_adherence(
    store: Store,
    method: GestureMethod,
    split: str,
    folder: Path,
    seed: int,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Ask for high, low, fast, slow, asymmetric and symmetric gestures and measure what comes.

    Table 2 and figure 2 of Habibie et al. 2022. Prints the tables and writes
    ``control_adherence.json``, ``.md`` and ``.png``.

    Args:
        store: The corpus of the method.
        method: A `GestureMethod` that `MakesStages`.
        split: The part whose speech is gestured to.
        folder: Where the files go.
        seed: Of first poses and of resampling.
        about: Name and value of what else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: The method takes no controls.
    """
    made = make_motions(store, method, split, seed)
    assert isinstance(method, MakesStages)
    search = method.matcher.search
    rows = measure_adherence(made, search, seed)
    changes = measure_change(made, seed)
    halves = (
        count_windows(SLOW_AND_LOW, search, made),
        count_windows(FAST_AND_HIGH, search, made),
    )
    fps = search.database.spec.fps
    frames = sum(len(values) for values in made.real[TESTED_CONTROLS[0].quantity])
    facts = {
        "corpus": f"{store.name}, fingerprint {store.fingerprint}",
        "part": f"{split}: {len(made.names)} recordings, {frames / fps / 60:.1f} min",
        "database": f"{len(search.database)} sequences, {search.database.hash}",
        "windows": f"{search.step} frames; {rows[0].windows.of:.0f} that a recording's motion is"
        " taken from, on average over recordings",
        "seed": str(seed),
        **dict(about),
    }
    result: dict[str, Any] = {
        "facts": facts,
        "controls": [_as_json(row) for row in rows],
        "changing": {
            "first_half": SLOW_AND_LOW,
            "second_half": FAST_AND_HIGH,
            "windows": [asdict(windows) for windows in halves],
            "quantities": [
                {**asdict(change), "verdict": change.shift.verdict} for change in changes
            ],
        },
    }
    write_json(folder / "control_adherence.json", result)
    write_text(folder / "control_adherence.md", _page(facts, rows, changes, halves))
    picture = folder / "control_adherence.png"
    example = _example(made, fps)
    shown = f"{store.name}, {made.names[example]}: what was asked for, and what came"
    plot_adherence(_panels(made, search, example), fps, shown, picture)
    print(adherence_table(rows, "text"))
    print("\n" + change_table(changes, "text"))
    print(f"\n{windows_text(halves)}")
    print(f"{facts['part']} of {store.name}; figure: {picture}")
    return result


def _as_json(row: Adherence) -> dict[str, Any]:
    values = asdict(row)
    tested = values.pop("tested")
    published = tested.pop("published")
    names = ("threshold", "k-NN mean", "k-NN deviation", "cGAN mean", "cGAN deviation")
    return {
        **tested,
        "where": row.tested.where,
        "unit": QUANTITIES[row.tested.quantity].unit,
        **values,
        "verdict": row.verdict,
        "published": dict(zip(names, published, strict=True)),
    }


def _page(
    facts: dict[str, str],
    rows: Sequence[Adherence],
    changes: Sequence[Change],
    halves: tuple[Windows, Windows],
) -> str:
    """The study as markdown."""
    return "\n".join(
        [
            "# Control adherence (Habibie et al. 2022, table 2)",
            "",
            "Mean (standard deviation over all frames) of recorded, uncontrolled and controlled"
            " motion; means within windows leave out the leap from the window before. A control is"
            " tested at a window's first and last frame. 95 %: over recordings. Windows: the mean"
            " over recordings, and the fewest. Paper: threshold, mean and deviation, on its own"
            " corpus.",
            "",
            adherence_table(rows, "markdown"),
            "",
            "## Slow and low in the first half, fast and high in the second",
            "",
            change_table(changes, "markdown"),
            "",
            windows_text(halves),
            "",
            "![over time](control_adherence.png)",
            "",
            *(f"* {markdown(name)}: {markdown(value)}" for name, value in facts.items()),
            "",
        ]
    )


def _example(made: Made, fps: float) -> int:
    """The first recording that fills the picture, or the longest."""
    lengths = [len(values) for values in made.real[TESTED_CONTROLS[0].quantity]]
    full = [i for i, length in enumerate(lengths) if length >= SHOWN_S * fps]
    return full[0] if full else int(np.argmax(lengths))


def _panels(made: Made, search: MatchingSearch, example: int) -> list[Panel]:
    def curves(name: str, quantity: str) -> dict[str, Any]:
        return {
            stage: 100 * series[quantity][example] for stage, series in made.motions[name].items()
        }

    def limit(quantity: str, percent: float) -> float:
        return 100 * thresholds(made, search, quantity, percent)[example]

    panels = []
    for tested in TESTED_CONTROLS:
        threshold = limit(tested.quantity, tested.percent)
        wanted = (threshold, math.inf) if tested.way > 0 else (-math.inf, threshold)
        panels.append(
            Panel(
                f"{tested.name}: {_in_words(tested.where)}",
                unit_of(tested.quantity),
                curves(tested.name, tested.quantity),
                list(curves(FREE, tested.quantity).values())[-1],
                [(0.0, math.inf, *wanted)],
            )
        )
    middle_s = len(made.real[TESTED_CONTROLS[0].quantity][example]) / search.database.spec.fps / 2
    for quantity in CHANGING_QUANTITIES:
        low, high = (limit(quantity, percent) for percent in CHANGING_PERCENTS)
        panels.append(
            Panel(
                f"{CHANGING}: {_in_words(quantity)}",
                unit_of(quantity),
                curves(CHANGING, quantity),
                list(curves(FREE, quantity).values())[-1],
                [(0.0, middle_s, -math.inf, low), (middle_s, math.inf, high, math.inf)],
            )
        )
    return panels


def _in_words(criterion: str) -> str:
    return criterion.replace("_", " ").replace(">=", "≥").replace("<=", "≤")
