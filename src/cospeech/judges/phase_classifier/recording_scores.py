"""A classifier against the annotation of whole recordings."""

from __future__ import annotations

import numpy as np

from cospeech.corpus.features.span_motion import native_frames
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.scores import PhaseScores, confusion_of


def recording_scores(classifier: FrozenPhaseClassifier, store: Store, split: str) -> PhaseScores:
    """Scores over every native frame of a split's annotated recordings.

    Each stretch of the split is labelled by itself, as users label their recordings.

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
        has_audio = store.recordings[span.recording].has_audio
        speech = store.speech(span) if classifier.pitch and has_audio else None
        first, stop = native_frames(store, span)
        found = classifier.label(store.motion(span.recording).slice(first, stop), speech)
        confusion += confusion_of(classifier.merge(phases[first:stop]), found, classes)
    if not confusion.any():
        raise CospeechError(
            f"{store.name}: no {split} recording has gesture phases",
            "use a corpus with annotated phases: data=synthetic or data=uci_phases",
        )
    return PhaseScores.of(confusion)
