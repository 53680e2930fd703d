"""The recordings protocol: generate over each whole recording, cut, compare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.evaluation.catalogue import Catalogue
from cospeech.evaluation.real_windows import judged_windows, long_enough, too_little, with_fields
from cospeech.methods.base import GestureMethod
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import to_evaluation_windows
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import to_upper_body
from cospeech.progress import progress_bar


def evaluate_recordings(
    method: GestureMethod,
    store: Store,
    split: str,
    encoder: GestureEncoder,
    catalogue: Catalogue,
    limit: int | None = None,
) -> dict[str, float]:
    """One method's numbers by the recordings protocol.

    No seed motion is given: the motion comes from speech (and the speaker, where known) alone.
    Recording i is generated from seed i. Recordings without sound can't be generated for, and are
    left out with a warning.

    Args:
        method: A trained method.
        store: The corpus.
        split: The split to judge on.
        encoder: The evaluation space.
        catalogue: The metrics.
        limit: At most so many recordings (debug runs).

    Returns:
        The values of `Catalogue.row`.

    Raises:
        CospeechError: No recording of the split has sound and the length of a window.
    """
    spans = long_enough(store, split)
    if not spans:
        raise too_little(store, store.splits[split], 0)
    spans = store.spans_with_sound(spans, f"{split} recordings")
    spans = with_fields(store, split, spans, catalogue.needs)[:limit]
    real, ids = judged_windows(store, split, spans, encoder, catalogue.needs)
    generated = []
    motions = generated_motions(method, store, spans, f"generating {split} recordings")
    for span, motion in zip(spans, motions, strict=True):
        windows = to_evaluation_windows(motion)
        expected = len(to_evaluation_windows(store.upper_body_motion(span)))
        if len(windows) != expected:
            raise CospeechError(
                f"{type(method).__name__} made {motion.duration:.2f} s of motion for recording"
                f" {store.recordings[span.recording].id}: {len(windows)} windows, not {expected}"
            )
        generated.append(windows)
    positions = torch.cat(generated)
    made = real.moving(positions, encoder.encode_all(positions))
    return catalogue.row(made, real, recording_ids=ids)


def generated_motions(
    method: GestureMethod, store: Store, spans: Sequence[Span], title: str, first_seed: int = 0
) -> Iterator[Motion]:
    """The ten joints of what a method makes of the speech of stretches, one after another.

    Without seed motion, for its speaker where known.

    Args:
        method: A trained method; as it was, in training mode or not, once all are made.
        store: The corpus.
        spans: Stretches with sound.
        title: Of the progress bar.
        first_seed: Stretch i is generated from this seed plus i.
    """
    training = method.training
    method.eval()
    for number, span in enumerate(progress_bar(spans, len(spans), title)):
        speaker = store.recordings[span.recording].speaker
        motion = method.generate(
            store.speech(span),
            speaker=speaker if speaker in store.speaker_ids else None,
            generator=torch.Generator().manual_seed(first_seed + number),
        )
        yield to_upper_body(motion)
    method.train(training)
