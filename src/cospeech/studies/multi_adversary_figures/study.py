"""All systems of a comparison on the same held-out speech: measured, drawn, written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
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
from cospeech.studies.multi_adversary_figures.findings import Verdict, judge
from cospeech.studies.multi_adversary_figures.generating import (
    in_paper_order,
    label_joints,
    motion_of,
)
from cospeech.studies.multi_adversary_figures.held_out import (
    VELOCITY_WINDOWS,
    HeldOut,
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
    SystemStatistics,
)
from cospeech.studies.multi_adversary_figures.measuring import measure_systems
from cospeech.studies.multi_adversary_figures.page import write_page
from cospeech.studies.multi_adversary_figures.tables import text_table
from cospeech.studies.trained_system import TrainedSystem

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
    facts = _facts(held_out, split, encoder, classifier, setting, statistics, seed)
    facts += about
    page = folder / "figures.html"
    write_page(page, store.name, split, setting, statistics, verdicts, facts, annotated)
    result = {"facts": dict(facts), **_as_json(setting, statistics, verdicts)}
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


def _facts(
    held_out: HeldOut,
    split: str,
    encoder: GestureEncoder,
    classifier: FrozenPhaseClassifier | None,
    setting: Setting,
    statistics: Sequence[SystemStatistics],
    seed: int,
) -> list[tuple[str, str]]:
    """Name and value of what a reader must know to do the study again."""
    store, takes = held_out.store, held_out.takes
    minutes = sum(len(take.joints) for take in takes) / FPS / 60
    overlap_s = (FRAMES - held_out.windows.spec.stride) / FPS
    windows = (
        f"{len(setting.window_recordings)} of 5 s, drawn from {len(held_out.windows)} of"
        f" {len(set(setting.window_recordings.tolist()))} recordings"
    )
    trained = [
        f"{system.name} (training seed{'s' * (len(system.seeds) > 1)}"
        f" {', '.join(map(str, system.seeds))})"
        for system in statistics[1:]
    ]
    phases = "none"
    if classifier is not None:
        pitch = " and pitch" if classifier.pitch else ", without pitch"
        phases = f"{', '.join(classifier.classes)}; from {', '.join(classifier.roles)}{pitch}"
    return [
        ("corpus", f"{store.name}, fingerprint {store.fingerprint}"),
        ("part", f"{split}: {len(takes)} recordings of 5 s and more, {minutes:.1f} min"),
        ("windows", windows + (f"; neighbours overlap by {overlap_s:g} s" if overlap_s else "")),
        ("systems", "; ".join(trained)),
        ("phase classifier", phases),
        ("FGD encoder", f"{encoder.source}, {encoder.sha256}"),
        ("joints", ", ".join(setting.roles)),
        ("seed of the draws", str(seed)),
    ]


def _as_json(
    setting: Setting, statistics: Sequence[SystemStatistics], verdicts: Sequence[Verdict]
) -> dict[str, Any]:
    """Every number of the page, SI units."""
    return {
        "phase_classes": list(setting.phase_classes),
        "bones": [[setting.roles[end] for end in bone] for bone in setting.bones],
        "systems": [_system_as_json(system) for system in statistics],
        "findings": [asdict(verdict) for verdict in verdicts],
    }


def _system_as_json(system: SystemStatistics) -> dict[str, Any]:
    phases = None
    if system.phases is not None:
        shown = ("shares", "mean_durations_s", "transitions")
        phases = {key: getattr(system.phases, key).tolist() for key in shown}
    return {
        "name": system.name,
        "seeds": list(system.seeds),
        "statistics": {
            key: {
                "value": number.value,
                "interval": number.interval,
                "by_seed": list(number.by_seed.values()),
            }
            for key, number in system.numbers.items()
        },
        "velocity_per_step": system.velocity.tolist(),
        "ranges": system.ranges.tolist(),
        "bone_mean_lengths": system.bones[:, 0].tolist(),
        "bone_variations": system.bones[:, 1].tolist(),
        "phases": phases,
    }
