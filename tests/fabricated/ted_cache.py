"""What the published preprocessing of the TED set caches for a clip.

See docs/facts/trimodal.md, section 3.6.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.formats.ted.clip import TedClip
from cospeech.formats.ted.filters import PASSED, PUBLISHED_RULES, WindowRules
from cospeech.formats.ted.samples import TedSample
from cospeech.formats.ted.windows import ClipWindows, spectrogram_columns
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE

PUBLISHED_MEAN_DIRECTION = (
    0.0154009, -0.9690125, -0.0884354, -0.0022264, -0.8655276, 0.4342174,
    -0.0035145, -0.8755367, -0.4121039, -0.9236511, 0.3061306, -0.0012415,
    -0.5155854, 0.8129665, 0.0871897, 0.2348464, 0.1846561, 0.8091402,
    0.9271948, 0.2960011, -0.013189, 0.5233978, 0.8092403, 0.0725451,
    -0.2037076, 0.1924306, 0.8196916,
)  # fmt: skip
"""Mean direction vector of the training poses (docs/facts/trimodal.md, section 3.2)."""


def direction_vectors(poses: NDArray[np.floating]) -> NDArray[np.float64]:
    """``(..., 9, 3)`` unit vectors along the bones of ``(..., 10, 3)``; a zero bone stays zero."""
    parents = list(UPPER_BODY.parents[1:])
    bones = poses[..., 1:, :].astype(np.float64) - poses[..., parents, :]
    lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    return np.divide(bones, lengths, out=np.zeros_like(bones), where=lengths > 0)


def cached_samples(
    clip: TedClip,
    vid: str,
    rules: WindowRules = PUBLISHED_RULES,
    mean_direction: Sequence[float] = PUBLISHED_MEAN_DIRECTION,
) -> Iterator[TedSample]:
    """The values in order; ``mean_direction`` is subtracted from the direction vectors."""
    cut = ClipWindows(clip, rules)
    for window in cut.kept:
        start, stop = window.start, window.start + rules.frames
        poses = cut.poses[start:stop].astype(np.float64)
        yield TedSample(
            words=window.words,
            poses=poses,
            directions=direction_vectors(poses) - np.reshape(mean_direction, (9, 3)),
            audio=_mirrored(
                clip.audio, cut.audio_start(start), round(rules.frames / rules.fps * SAMPLE_RATE)
            ),
            spectrogram=_mirrored(
                clip.spectrogram,
                math.floor(start / len(cut) * clip.spectrogram.shape[1]),
                spectrogram_columns(rules.frames, rules.fps),
            ),
            aux={
                "vid": vid,
                "start_frame_no": clip.start_frame + start,
                "end_frame_no": clip.start_frame + stop,
                "start_time": window.start_s,
                "end_time": window.end_s,
                "is_correct_motion": True,
                "filtering_message": PASSED,
            },
        )


def _mirrored(values: NDArray[np.floating], start: int, count: int) -> NDArray[np.floating]:
    """`count` steps along the last axis; past the end they are mirrored."""
    piece = values[..., start : start + count]
    missing = count - piece.shape[-1]
    if not missing:
        return piece
    return np.pad(piece, [(0, 0)] * (values.ndim - 1) + [(0, missing)], mode="symmetric")
