"""What a study's files say besides its figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cospeech.corpus.store import Store
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.gesture_statistics.findings import Verdict
from cospeech.metrics.gesture_statistics.systems import Setting, SystemStatistics
from cospeech.studies.gestures.held_out import FPS, FRAMES, HeldOut
from cospeech.studies.gestures.systems import TrainedSystem, in_paper_order


def study_facts(
    store: Store,
    encoder: GestureEncoder,
    split: str,
    systems: Sequence[TrainedSystem],
    classifier: FrozenPhaseClassifier | None,
    setting: Setting,
    held_out: HeldOut,
    seed: int,
) -> list[tuple[str, str]]:
    """Name and value of what a reader must know to do the study again."""
    minutes = sum(len(take.joints) for take in held_out.takes) / FPS / 60
    overlap = FRAMES - held_out.windows.spec.stride
    windows = (
        f"{len(setting.window_recordings)} of 5 s, drawn from {len(held_out.windows)} of"
        f" {len(set(setting.window_recordings.tolist()))} recordings"
    )
    trained = dict[str, list[int]]()
    for system in in_paper_order(systems):
        trained.setdefault(system.name, []).append(system.seed)
    judge_text = "none"
    if classifier is not None:
        judge_text = f"{', '.join(classifier.classes)}; from {', '.join(classifier.roles)}" + (
            " and pitch" if classifier.pitch else ", without pitch"
        )
    return [
        ("corpus", f"{store.name}, fingerprint {store.fingerprint}"),
        ("part", f"{split}: {len(held_out.takes)} recordings of 5 s and more, {minutes:.1f} min"),
        ("windows", windows + (f"; neighbours overlap by {overlap / FPS:g} s" if overlap else "")),
        (
            "systems",
            "; ".join(
                f"{name} (training seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))})"
                for name, seeds in trained.items()
            ),
        ),
        ("phase classifier", judge_text),
        ("FGD encoder", f"{encoder.source}, {encoder.sha256}"),
        ("joints", ", ".join(setting.roles)),
        ("seed of the draws", str(seed)),
    ]


def as_json(
    setting: Setting, statistics: Sequence[SystemStatistics], verdicts: Sequence[Verdict]
) -> dict[str, Any]:
    """Every number of the page, SI units."""
    return {
        "phase_classes": list(setting.phase_classes),
        "bones": [[setting.roles[end] for end in bone] for bone in setting.bones],
        "systems": [_system_as_json(system) for system in statistics],
        "findings": [
            {
                "claim": verdict.finding.claim,
                "section": verdict.finding.section,
                "answer": verdict.answer,
                "not_run": list(verdict.missing),
                "comparisons": [
                    {
                        "statistic": part.comparison.statistic,
                        "smaller": [part.comparison.smaller, part.smaller],
                        "larger": [part.comparison.larger, part.larger],
                        "factor": part.comparison.factor,
                        "holds": part.holds,
                        "clear": part.clear,
                        "seeds_that_agree": list(part.seeds),
                    }
                    for part in verdict.parts
                ],
            }
            for verdict in verdicts
        ],
    }


def _system_as_json(system: SystemStatistics) -> dict[str, Any]:
    phases = system.phases
    return {
        "name": system.name,
        "seeds": list(system.seeds),
        "statistics": {
            key: {
                "value": estimate.value,
                "interval": system.intervals[key],
                "by_seed": [seed.value for seed in system.by_seed[key]],
            }
            for key, estimate in system.estimates.items()
        },
        "velocity_per_step": system.velocity.tolist(),
        "ranges": system.ranges.tolist(),
        "bone_mean_lengths": system.bones[:, 0].tolist(),
        "bone_variations": system.bones[:, 1].tolist(),
        "phases": None
        if phases is None
        else {
            "shares": phases.shares.tolist(),
            "mean_durations_s": phases.mean_durations_s.tolist(),
            "transitions": phases.transitions.tolist(),
        },
    }
