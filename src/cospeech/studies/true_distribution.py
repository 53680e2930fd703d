"""How far systems are from the true distribution of motion, given the speech."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.synthetic.rerolls import rerolls
from cospeech.errors import CospeechError
from cospeech.evaluation import generated_motions, long_enough
from cospeech.evaluation.real_windows import too_little
from cospeech.metrics.energy_score import energy_score
from cospeech.metrics.evaluation_windows import to_evaluation_windows
from cospeech.metrics.resampling import Estimate, Resampling, combined
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import EVALUATION_FPS, UPPER_BODY
from cospeech.progress import progress_bar
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import Column, format_table
from cospeech.studies.trained_system import TrainedSystem

logger = logging.getLogger(__name__)

SAMPLES, TRUE = 5, 5
"""Motions of a speech that a system makes, and true ones that they are compared with."""
RESAMPLES = 2000
ORACLE, SAME_SPEAKER = "oracle", "same speaker, other speech"


@dataclass(frozen=True, eq=False)
class ScoredSystem:
    """A system's energy score.

    Attributes:
        name: Of the system.
        seeds: Of its trainings.
        samples: Motions of each speech that it was scored by; 1 of one that has nothing random.
        score: In centimetres.
        over_same_speaker: Less that of the same speaker's motion to other speech; below 0 a system
            uses what it hears.
    """

    name: str
    seeds: tuple[int, ...]
    samples: int
    score: Estimate
    over_same_speaker: Estimate | None


def true_distribution(
    store: Store,
    split: str,
    folder: Path,
    systems: Sequence[TrainedSystem],
    seed: int,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Score systems against what else could have been moved to the same speech.

    Rows beside them: another five draws of the true distribution, recorded motion of the same and
    of other speakers to other speech, and both mean poses. Prints a table with 95 % intervals over
    recordings and writes ``true_distribution.json``.

    Args:
        store: The embedded corpus, of which motion can be drawn anew.
        split: The part to judge on: ``"val"`` or ``"test"``.
        folder: Where the file goes.
        systems: Trained systems; those of one name are seeds of one row.
        seed: Of the draws of recorded motion and of the resampling.
        about: Name and value of what else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: It is the training part or one without a recording as long as a window, or
            motion can't be drawn anew (`rerolls`).
    """
    if split == "train":
        raise CospeechError("systems have seen the training part", "judge split=test or split=val")
    spans = long_enough(store, split)
    if not spans:
        raise too_little(store, store.splits[split], 0)
    truth = _Truth(store, spans)
    resampling = Resampling(truth.recording_of_window, RESAMPLES, seed)
    rng = np.random.default_rng(seed)
    made: dict[str, list[tuple[int | None, Tensor]]] = {
        ORACLE: [(None, truth.others)],
        **{name: [(None, motions)] for name, motions in _recorded(store, spans, truth, rng)},
    }
    for system in systems:
        motions = _made(system, store, spans)
        made.setdefault(system.name, []).append((system.seed, motions))
    scores = {
        name: resampling.mean(
            np.mean([100 * energy_score(motions, truth.motions) for _, motions in each], axis=0)
        )
        for name, each in made.items()
    }
    least = scores.get(SAME_SPEAKER)
    rows = [
        ScoredSystem(
            name,
            tuple(seed for seed, _ in each if seed is not None),
            max(len(motions) for _, motions in each),
            scores[name],
            None if least is None else combined(np.subtract, scores[name], least),
        )
        for name, each in made.items()
    ]
    result = {
        **dict(about),
        "corpus": store.name,
        "fingerprint": store.fingerprint,
        "split": split,
        "recordings": len(spans),
        "windows": len(truth.recording_of_window),
        "true_motions": TRUE,
        "systems": {row.name: _as_json(row) for row in rows},
    }
    write_json(folder / "true_distribution.json", result)
    print(scores_table(rows))
    told = (
        f"\n{split}: {len(spans)} recordings of {store.name}. 0 is the true distribution. Who"
        f" knows the speaker's gestures and not the speech is at {SAME_SPEAKER!r}; what uses the"
        " speech is below it."
    )
    print(told)
    return result


class _Truth:
    """True motions of each window: the recorded one and others, in two sets that share none.

    Attributes:
        motions: ``(5, n, 34, 10, 3)``, the recorded motion first.
        others: As many more.
        recording_of_window: ``(n,)``.
    """

    def __init__(self, store: Store, spans: Sequence[Span]) -> None:
        drawn = dict(
            progress_bar(
                rerolls(store, [span.recording for span in spans], TRUE - 1 + SAMPLES),
                len(spans),
                "drawing motion anew",
            )
        )
        windows = []
        for span in spans:
            recorded = store.upper_body_motion(span)
            again = drawn[span.recording][:, span.start : span.start + len(recorded)]
            motions = [Motion(UPPER_BODY, EVALUATION_FPS, positions) for positions in again]
            windows.append(torch.stack([to_evaluation_windows(m) for m in (recorded, *motions)]))
        every = torch.cat(windows, dim=1)
        self.motions, self.others = every[:TRUE], every[TRUE:]
        self.recording_of_window = np.repeat(range(len(spans)), [w.shape[1] for w in windows])


def _recorded(
    store: Store, spans: Sequence[Span], truth: _Truth, rng: np.random.Generator
) -> list[tuple[str, Tensor]]:
    """Recorded training motion in the place of the true one, and mean poses."""
    heard = long_enough(store, "train")
    windows = [to_evaluation_windows(store.upper_body_motion(span)) for span in heard]
    speakers = [store.recordings[span.recording].speaker for span in heard]
    of_speaker = {
        name: torch.cat([w for w, own in zip(windows, speakers, strict=True) if own == name])
        for name in dict.fromkeys(speakers)
    }
    judged = [store.recordings[spans[i].recording].speaker for i in truth.recording_of_window]
    everyone = torch.cat(windows)
    mean_pose = everyone.mean(dim=(0, 1)).expand_as(truth.motions[:1])
    rows = []
    if set(judged) <= set(of_speaker):
        rows.append((SAME_SPEAKER, _drawn([of_speaker[name] for name in judged], rng)))
        if len(of_speaker) > 1:
            rows.append(("another speaker", _drawn(_of_others(of_speaker, judged), rng)))
        rows.append(("mean pose of the speaker", _mean_poses(of_speaker, judged)))
    else:
        logger.warning("some speaker has no training motion: no rows of motion to other speech")
    return [*rows, ("mean pose", mean_pose)]


def _of_others(of_speaker: dict[str, Tensor], judged: Sequence[str]) -> list[Tensor]:
    others = {
        name: torch.cat([windows for other, windows in of_speaker.items() if other != name])
        for name in set(judged)
    }
    return [others[name] for name in judged]


def _drawn(pools: Sequence[Tensor], rng: np.random.Generator) -> Tensor:
    """``(5, n, 34, 10, 3)``: for each window five different ones of its pool, or all."""
    count = min(SAMPLES, *map(len, pools))
    chosen = [pool[rng.choice(len(pool), count, replace=False)] for pool in pools]
    return torch.stack(chosen, dim=1)


def _mean_poses(of_speaker: dict[str, Tensor], judged: Sequence[str]) -> Tensor:
    poses = {name: windows.mean(dim=(0, 1)) for name, windows in of_speaker.items()}
    frames = next(iter(of_speaker.values())).shape[1]
    return torch.stack([poses[name].expand(frames, -1, -1) for name in judged])[None]


def _made(system: TrainedSystem, store: Store, spans: Sequence[Span]) -> Tensor:
    """``(m, n, 34, 10, 3)``: five motions, or one of a method with which a second is the same."""

    def motion(number: int, stretches: Sequence[Span]) -> Tensor:
        title = f"{system.name}, seed {system.seed}, motion {number + 1}"
        motions = generated_motions(system.method, store, stretches, title, 1000 * number)
        return torch.cat([to_evaluation_windows(motion) for motion in motions])

    first, again = motion(0, spans), motion(1, spans[:1])
    if torch.equal(again, first[: len(again)]):
        return first[None]
    return torch.stack([first, *(motion(number, spans) for number in range(1, SAMPLES))])


def _as_json(row: ScoredSystem) -> dict[str, Any]:
    over = row.over_same_speaker
    return {
        "seeds": list(row.seeds),
        "samples": row.samples,
        "energy_score_cm": row.score.value,
        "interval": row.score.interval(),
        "over_same_speaker_cm": None if over is None else over.value,
        "over_same_speaker_interval": None if over is None else over.interval(),
    }


def scores_table(rows: Sequence[ScoredSystem]) -> str:
    """A row per system: motions, score, and how far it is from the same speaker's motion."""
    columns = (
        Column("system", " "),
        Column("seeds", "seeds"),
        Column("samples", "motions"),
        Column("score", "energy score, cm", "lower"),
        Column("over", f"minus {SAME_SPEAKER}"),
    )
    return format_table(
        [
            {
                "system": row.name,
                "seeds": ", ".join(map(str, row.seeds)) or None,
                "samples": row.samples,
                "score": _told(row.score),
                "over": None if row.over_same_speaker is None else _told(row.over_same_speaker),
            }
            for row in rows
        ],
        columns,
    )


def _told(estimate: Estimate) -> str:
    found = estimate.interval()
    interval = "" if found is None else f" ({found[0]:.2f} to {found[1]:.2f})"
    return f"{estimate.value:.2f}{interval}"
