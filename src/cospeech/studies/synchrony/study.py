"""Recorded motion, mismatched speech and systems, on the same held-out speech."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.evaluation import real_windows, reference_rows, standard_catalogue
from cospeech.files import write_text
from cospeech.metrics.beat_consistency import BeatClip, MotionBeats, StressedSyllables, beat_clip
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import EvaluationWindows, to_evaluation_windows
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import EVALUATION_FRAMES, to_upper_body
from cospeech.progress import progress_bar
from cospeech.reporting.markup import markdown
from cospeech.reporting.record import write_json
from cospeech.speech.speech import Speech
from cospeech.studies.synchrony.picture import plot_synchrony
from cospeech.studies.synchrony.rows import (
    Detectors,
    SynchronyRow,
    how_it_moves,
    lag_of,
    measure,
    mismatched_clips,
)
from cospeech.studies.synchrony.tables import as_json, tables

RECORDED = "recorded motion"
MISMATCHED = "recorded, mismatched speech"
PARTNERS = 5
"""Other recordings whose speech each recorded motion is mismatched with."""

_logger = logging.getLogger(__name__)

SpeechToMotion = Callable[[Speech, str], Motion]
"""From speech and the name of who speaks to motion that covers the speech exactly, at any rate and
on any skeleton that has the ten evaluation joints (`to_upper_body`)."""


def synchrony(
    store: Store,
    encoder: GestureEncoder,
    split: str,
    folder: Path,
    systems: Mapping[str, SpeechToMotion],
    seed: int,
    lag_s: float | None = None,
    detectors: Detectors | None = None,
    limit: int | None = None,
    about: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Measure systems as table 3 of Habibie et al. 2022 has them rated, without raters.

    Naturalness: Fréchet gesture distance, seams, jitter and speed. Synchrony: beat consistency over
    chance, in both directions, for every system and for recorded motion under its own and under
    other recordings' speech. Prints the tables and writes ``synchrony.json``, ``synchrony.md`` and
    ``synchrony.png``.

    Args:
        store: The corpus.
        encoder: The common evaluation space.
        split: The part to judge on.
        folder: Where the files go.
        systems: Name -> what makes motion for speech, in the order of the table.
        seed: Of the mismatch and the resampling.
        lag_s: Seconds by which speech follows motion; None takes the lag, from 0 to 0.4 s, at which
            recorded motion of the training part is most consistent. Table and JSON also have the
            lifts without lag.
        detectors: What counts as a beat; None takes `MotionBeats` and `StressedSyllables`.
            Publications take all onsets of speech (`SpeechOnsets`), about three times as many.
        limit: At most so many recordings (debug runs).
        about: Name and value of what else a reader must know to do the study again.

    Returns:
        What the JSON holds.

    Raises:
        CospeechError: No recording has sound and the length of an evaluation window, no speech has
            beats, or a system's motion doesn't cover the speech.
    """
    detectors = detectors or Detectors(MotionBeats(), StressedSyllables())
    spans = _spans(store, split)[:limit]
    speeches = [(store.speech(span), store.recordings[span.recording].speaker) for span in spans]
    recorded = [store.upper_body_motion(span) for span in spans]
    names = [store.recordings[span.recording].id for span in spans]

    own = _clips(store, spans, detectors, f"beats of the {split} part")
    if all(len(clip.audio_beats) < 2 for clip in own):
        raise CospeechError(
            f"{store.name}: no {split} recording has two beats of speech",
            "use recordings of speech, or another detector",
        )
    from_training = lag_s is None
    if lag_s is None:
        training = _clips(store, _spans(store, "train"), detectors, "beats of the training part")
        lag_s = lag_of(training, seed)
    catalogue = standard_catalogue()
    floor = reference_rows(store, encoder, split, seed, catalogue).get("real_halves")
    rows = [measure(RECORDED, own, lag_s, seed, floor, how_it_moves(recorded))]
    rng = np.random.default_rng(seed)
    if swapped := mismatched_clips(own, PARTNERS, rng):
        rows.append(measure(MISMATCHED, swapped, lag_s, seed, None, None))
    else:
        _logger.warning("%s: one %s recording, so no mismatched speech", store.name, split)
    recorded_windows, ids = real_windows(store, spans)
    real = EvaluationWindows(recorded_windows, encoder.encode_all(recorded_windows))
    for name, system in systems.items():
        motions = _generated(name, system, speeches, recorded, names)
        windows = torch.cat([to_evaluation_windows(motion) for motion in motions])
        made = real.moving(windows, encoder.encode_all(windows))
        fgd = catalogue.row(made, real, recording_ids=ids, seed=seed)
        clips = [
            replace(clip, motion_beats=detectors.motion(motion))
            for clip, motion in zip(own, motions, strict=True)
        ]
        rows.append(measure(name, clips, lag_s, seed, fgd, how_it_moves(motions)))
    return _write(store, encoder, split, folder, rows, lag_s, from_training, detectors, seed, about)


def _spans(store: Store, split: str) -> list[Span]:
    long_enough = [
        span for span in store.splits[split] if span.stop - span.start >= EVALUATION_FRAMES
    ]
    return store.spans_with_sound(long_enough, f"{split} recordings")


def _clips(store: Store, spans: Sequence[Span], detectors: Detectors, what: str) -> list[BeatClip]:
    return [
        beat_clip(
            store.recordings[span.recording].id,
            store.upper_body_motion(span),
            store.speech(span),
            detectors.motion,
            detectors.audio,
        )
        for span in progress_bar(spans, len(spans), what)
    ]


def _generated(
    name: str,
    system: SpeechToMotion,
    speeches: Sequence[tuple[Speech, str]],
    recorded: Sequence[Motion],
    recordings: Sequence[str],
) -> list[Motion]:
    motions = []
    for (speech, speaker), real, recording in zip(
        progress_bar(speeches, len(speeches), f"generating with {name}"),
        recorded,
        recordings,
        strict=True,
    ):
        motion = to_upper_body(system(speech, speaker))
        windows = len(to_evaluation_windows(motion))
        expected = len(to_evaluation_windows(real))
        if windows != expected:
            raise CospeechError(
                f"{name} made {motion.duration:.2f} s of motion for recording {recording}, which"
                f" lasts {real.duration:.2f} s: {windows} windows, not {expected}"
            )
        motions.append(motion)
    return motions


def _write(
    store: Store,
    encoder: GestureEncoder,
    split: str,
    folder: Path,
    rows: Sequence[SynchronyRow],
    lag_s: float,
    from_training: bool,
    detectors: Detectors,
    seed: int,
    about: Sequence[tuple[str, str]],
) -> dict[str, Any]:
    result: dict[str, Any] = {
        **dict(about),
        "corpus": store.name,
        "fingerprint": store.fingerprint,
        "split": split,
        "seed": seed,
        "encoder": {"sha256": encoder.sha256, "source": encoder.source},
        "lag_s": lag_s,
        "lag_from_training_part": from_training,
        "detectors": {"motion": repr(detectors.motion), "audio": repr(detectors.audio)},
        **as_json(rows),
    }
    write_json(folder / "synchrony.json", result)
    picture = folder / "synchrony.png"
    plot_synchrony(rows, lag_s, f"{store.name}, {split}", picture)
    write_text(
        folder / "synchrony.md",
        f"# Synchrony on {markdown(store.name)}, {split}\n\n"
        f"{tables(rows, result, 'markdown')}\n\n"
        "![Lifts with intervals, and over the lag](synchrony.png)\n",
    )
    print(tables(rows, result, "text"))
    print(f"\nfigure: {picture}")
    return result
