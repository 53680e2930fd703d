"""A classifier against the annotation of whole recordings."""

from __future__ import annotations

import math

import numpy as np

from cospeech.corpus.splits import Span
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import CospeechError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.scores import PhaseScores, confusion_of


def recording_scores(classifier: FrozenPhaseClassifier, store: Store, split: str) -> PhaseScores:
    """Scores over every native frame of a split's annotated recordings.

    Each recording is labelled as a whole, as users label theirs; where only a part of it belongs to
    the split, only that part counts.

    Args:
        classifier: Any.
        store: A corpus with annotated phases.
        split: ``"train"``, ``"val"`` or ``"test"``.

    Raises:
        CospeechError: Nothing is annotated, or the skeletons lack the classifier's joints.
    """
    classes = len(classifier.classes)
    confusion = np.zeros((classes, classes), dtype=np.int64)
    for span in store.splits[split]:
        phases = store.phases(span.recording)
        if phases is None:
            continue
        recording = store.recordings[span.recording]
        whole = Span(span.recording, 0, recording.frames)
        speech = store.speech(whole) if classifier.pitch and recording.has_audio else None
        motion = store.motion(span.recording)
        labels = classifier.merge(phases)
        found = classifier.label(motion, speech)
        first = math.ceil(span.start / EVALUATION_FPS * motion.fps - 1e-6)
        stop = len(motion)
        if span.stop < recording.frames:
            stop = math.ceil(span.stop / EVALUATION_FPS * motion.fps - 1e-6)
        confusion += confusion_of(labels[first:stop], found[first:stop], classes)
    if not confusion.any():
        raise CospeechError(
            f"{store.name}: no {split} recording has gesture phases",
            "use a corpus with annotated phases: data=synthetic or data=uci_phases",
        )
    return PhaseScores.of(confusion)
