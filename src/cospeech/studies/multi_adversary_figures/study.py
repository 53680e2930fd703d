"""All systems of a comparison on the same held-out speech: measured, drawn, written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import CospeechError
from cospeech.evaluation import evaluate_recordings, reference_rows, standard_catalogue
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.capabilities import MakesJoints
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.phase_structure import PhaseStructure, count_phases, phase_structure
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.reporting.record import write_json
from cospeech.studies.multi_adversary_figures.findings import judge
from cospeech.studies.multi_adversary_figures.generating import (
    TrainedSystem,
    in_paper_order,
    label_joints,
    motion_of,
)
from cospeech.studies.multi_adversary_figures.held_out import (
    VELOCITY_WINDOWS,
    held_out_part,
    takes_of,
    training_mean_pose,
)
from cospeech.studies.multi_adversary_figures.measured import (
    FPS,
    FRAMES,
    REAL,
    Setting,
    SystemMotion,
)
from cospeech.studies.multi_adversary_figures.measuring import measure_systems
from cospeech.studies.multi_adversary_figures.page import write_page
from cospeech.studies.multi_adversary_figures.results import as_json, study_facts
from cospeech.studies.multi_adversary_figures.tables import text_table

RANGE_WINDOWS = 50
"""As many as the paper's figure 11 takes; fewer where the part has fewer."""


def multi_adversary_figures(
    store: Store,
    encoder: GestureEncoder,
    split: str,
    folder: Path,
    systems: Sequence[TrainedSystem],
    classifier: FrozenPhaseClassifier | None,
    seed: int,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Draw the paper's figures 1 and 11 and measure all systems on the same held-out speech.

    Prints the table and writes ``figures.html`` and ``figures.json``.

    Args:
        store: The corpus, that of all systems.
        encoder: The common evaluation space.
        split: The part to judge on.
        folder: Where the files go.
        systems: Trained systems.
        classifier: Labels real and generated motion alike; None leaves phases out.
        seed: Of the choice of windows and the resampling.
        about: Name and value of what else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: No systems, one that doesn't make gesturing joints, or motion that does not
            fit the speech.
    """
    for system in systems:
        if not isinstance(system.method, MakesJoints):
            raise CospeechError(
                f"{system.name}: a {type(system.method).__name__} makes no gesturing joints",
                "give runs of model=multi_adversary",
            )
    if not systems:
        raise CospeechError("no trained systems", "give the folders of finished runs: runs=[DIR]")
    layout = gesture_joints(store.skeletons[0])
    held_out = held_out_part(store, split)
    rng = np.random.default_rng(seed)
    count = min(VELOCITY_WINDOWS, len(held_out.windows))
    chosen = np.sort(rng.permutation(len(held_out.windows))[:count])
    setting = Setting(
        roles=layout.roles,
        bones=layout.bones,
        mean_pose=training_mean_pose(store),
        window_recordings=held_out.windows.recordings[chosen],
        range_windows=np.sort(rng.permutation(count)[:RANGE_WINDOWS]),
        phase_classes=() if classifier is None else classifier.classes,
    )

    def judged(motion: SystemMotion, row: Mapping[str, float]) -> SystemMotion:
        """With its phases, and its distance in the evaluation space."""
        phases = None
        if classifier is not None:
            phases = [
                label_joints(classifier, joints, layout, take.pitch)
                for joints, take in zip(motion.recordings, held_out.takes, strict=True)
            ]
        interval = (row["fgd_low"], row["fgd_high"]) if "fgd_low" in row else None
        return replace(motion, phases=phases, fgd=row.get("fgd"), fgd_interval=interval)

    catalogue = standard_catalogue()
    halves = reference_rows(store, encoder, split, seed, catalogue).get("real_halves", {})
    windows = held_out.windows.batch(chosen).require("joints").numpy()
    recordings = [take.joints for take in held_out.takes]
    motions = [judged(SystemMotion(REAL, windows, recordings, recordings), halves)]
    for system in in_paper_order(systems):
        motion = motion_of(system, held_out, chosen, layout.roles)
        row = evaluate_recordings(system.method, store, split, encoder, catalogue)
        motions.append(judged(motion, row))
    statistics = measure_systems(setting, motions, seed)
    verdicts = judge(statistics)
    annotated = None if classifier is None else _annotated(store, split, classifier)
    facts = study_facts(held_out, split, encoder, classifier, setting, statistics, seed)
    facts += about
    page = folder / "figures.html"
    write_page(page, store.name, split, setting, statistics, verdicts, facts, annotated)
    result = {"facts": dict(facts), **as_json(setting, statistics, verdicts)}
    write_json(folder / "figures.json", result)
    print(text_table(statistics, verdicts))
    print(f"\n{count} {split} windows of {store.name}; figures: {page}")
    return result


def _annotated(
    store: Store, split: str, classifier: FrozenPhaseClassifier
) -> PhaseStructure | None:
    """The phases as annotated, in the classifier's classes; None where some recording has none."""
    spans = store.splits[split]
    if not all(store.recordings[span.recording].has_phases for span in spans):
        return None
    spec, needs = WindowSpec(FPS, FRAMES, 0, FRAMES), frozenset({"phases"})
    windows = WindowDataset(store, split, spec, needs)
    counts = [
        count_phases(
            classifier.merge(windows.tracks.values("phases", sequence)),
            len(classifier.classes),
            FPS,
        )
        for sequence in takes_of(windows)
    ]
    return phase_structure(counts, FPS)
