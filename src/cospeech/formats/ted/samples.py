"""A sample that the published preprocessing of the TED set caches.

See docs/facts/trimodal.md, section 3.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.speech import Word


@dataclass(frozen=True, eq=False)
class TedSample:
    """One value of a published cache database.

    Attributes:
        words: Words that overlap the window, on the video's clock.
        poses: ``(T, 10, 3)`` float64.
        directions: ``(T, 9, 3)`` float64 direction vectors, mean subtracted.
        audio: 16 kHz samples.
        spectrogram: ``(128, m)``.
        aux: ``vid``, ``start_frame_no``, ``end_frame_no`` (both the clip's native first frame plus
            an offset at 15 fps), ``start_time``, ``end_time`` (s), ``is_correct_motion``,
            ``filtering_message``.
    """

    words: tuple[Word, ...]
    poses: NDArray[np.float64]
    directions: NDArray[np.float64]
    audio: NDArray[np.floating]
    spectrogram: NDArray[np.floating]
    aux: dict[str, Any]
