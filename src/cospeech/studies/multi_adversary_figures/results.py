"""What the study's files say besides its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.metrics.encoder import GestureEncoder
from cospeech.studies.multi_adversary_figures.findings import Verdict
from cospeech.studies.multi_adversary_figures.held_out import HeldOut
from cospeech.studies.multi_adversary_figures.measured import (
    FPS,
    FRAMES,
    Setting,
    SystemStatistics,
)


def study_facts(
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


def as_json(
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
