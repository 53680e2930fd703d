"""Trained systems on held-out speech in which every stroke's cause is known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.files import write_text
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.markup import markdown
from cospeech.reporting.record import write_json
from cospeech.studies.caused_gestures.generating import generated_motion, reference_motions
from cospeech.studies.caused_gestures.measuring import (
    Setting,
    SystemMotion,
    SystemNumbers,
    make_setting,
    measure_system,
)
from cospeech.studies.caused_gestures.picture import plot_caused_gestures
from cospeech.studies.caused_gestures.strokes import read_takes
from cospeech.studies.caused_gestures.tables import as_json, tables
from cospeech.studies.trained_system import TrainedSystem


def caused_gestures(
    store: Store,
    split: str,
    folder: Path,
    systems: Sequence[TrainedSystem],
    seed: int,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Ask whether words bring their gestures, whether beats come in time, and whether motion lasts.

    In the embedded corpus a stroke is caused by a word's meaning or by a stressed syllable. For
    every system: is the concept recognised from the wrists, do the wrists move where a stroke was
    made for a word or as a beat, do their peaks of speed meet the beats; do poses drift from the
    training's over a take, and are they damped (docs/judging.md). Prints the tables and writes
    ``caused_gestures.json``, ``.md`` and ``.png``.

    Args:
        store: The corpus of all systems.
        split: The part to judge on: ``"val"`` or ``"test"``.
        folder: Where the files go.
        systems: Trained systems; those of one name are seeds of one row, in the order of the table.
        seed: Of the resampling.
        about: Name and value of what else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: It is the training part; the corpus doesn't say what caused its gestures; or
            a system's motion doesn't cover the speech.
    """
    if split == "train":
        raise CospeechError(
            "the training part teaches what a concept looks like", "judge split=test or split=val"
        )
    takes = read_takes(store, store.splits[split])
    training = read_takes(store, store.splits["train"])
    setting = make_setting(training, takes, seed)
    rows = [measure_system(members, setting) for members in reference_motions(takes, training)]
    made = dict[str, list[SystemMotion]]()
    for system in systems:
        made.setdefault(system.name, []).append(generated_motion(system, store, takes))
    rows += [measure_system(members, setting) for members in made.values()]
    return _write(store, split, folder, setting, rows, seed, about)


def _write(
    store: Store,
    split: str,
    folder: Path,
    setting: Setting,
    rows: Sequence[SystemNumbers],
    seed: int,
    about: Sequence[tuple[str, str]],
) -> dict[str, Any]:
    minutes = sum(len(take.positions) for take in setting.takes) / EVALUATION_FPS / 60
    concepts = setting.shapes.concepts
    facts = {
        "corpus": f"{store.name}, fingerprint {store.fingerprint}",
        "part": f"{split}: {len(setting.takes)} takes, {minutes:.1f} min",
        "concepts": ", ".join(concepts),
        "seed of the draws": str(seed),
        **dict(about),
    }
    result: dict[str, Any] = {"facts": facts, **as_json(rows)}
    write_json(folder / "caused_gestures.json", result)
    picture = folder / "caused_gestures.png"
    plot_caused_gestures(rows, f"{store.name}, {split}", picture)
    write_text(
        folder / "caused_gestures.md",
        "\n".join(
            [
                f"# Caused gestures of {markdown(store.name)}, {split}",
                "",
                tables(rows, len(concepts), "markdown"),
                "",
                "![Who answers what, and how late](caused_gestures.png)",
                "",
                *(f"* {markdown(name)}: {markdown(value)}" for name, value in facts.items()),
                "",
            ]
        ),
    )
    print(tables(rows, len(concepts), "text"))
    print(f"\n{facts['part']} of {store.name}; figure: {picture}")
    return result
