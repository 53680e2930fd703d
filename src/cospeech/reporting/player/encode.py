"""Clips as compact JSON values: what the player's scripts decode."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.reporting.figure import PARTS, check_drawable, figure_of
from cospeech.reporting.framing import Extent, extents, facing
from cospeech.reporting.joint_names import wrists
from cospeech.speech.speech import SAMPLE_RATE, Speech

_INT16_MAX = 32767


def encode_positions(positions: NDArray[np.float32]) -> dict[str, Any]:
    """Positions as 16-bit integers: ``origin + quantum * integer``.

    The quantum fits the clip's own extent, so the error is half of ``extent / 65534``: 0.02 mm
    for a clip that stays within 2.6 m, under 1 mm up to 131 m.

    Args:
        positions: ``(T, J, 3)``, metres, finite.

    Returns:
        ``origin`` (three numbers, metres), ``quantum`` (metres) and ``data`` (base64 of
        little-endian int16, frame-major).
    """
    low = positions.min(axis=(0, 1)).astype(np.float64)
    high = positions.max(axis=(0, 1)).astype(np.float64)
    origin = (low + high) / 2
    quantum = max(float((high - low).max()) / (2 * _INT16_MAX), 1e-6)
    integers = np.rint((positions - origin) / quantum).astype("<i2")
    return {
        "origin": origin.tolist(),
        "quantum": quantum,
        "data": base64.b64encode(integers.tobytes()).decode("ascii"),
    }


def encode_audio(speech: Speech) -> dict[str, Any] | None:
    """The waveform as MP3 where libsndfile can write it, else as 16-bit WAV; None when empty.

    Every browser plays both; MP3 is about an eighth of the size. ``samples`` is the true length,
    which the page uses to take off an MP3 decoder's padding.
    """
    import soundfile

    if not len(speech.waveform):
        return None
    if not np.isfinite(speech.waveform).all():
        raise CospeechError("the waveform has values that are not finite", "load the audio again")
    as_mp3 = "MP3" in soundfile.available_formats()
    buffer = io.BytesIO()
    if as_mp3:
        soundfile.write(
            buffer,
            speech.waveform,
            SAMPLE_RATE,
            format="MP3",
            subtype="MPEG_LAYER_III",
            compression_level=0.7,
            bitrate_mode="VARIABLE",
        )
    else:
        soundfile.write(buffer, speech.waveform, SAMPLE_RATE, format="WAV", subtype="PCM_16")
    return {
        "mime": "audio/mpeg" if as_mp3 else "audio/wav",
        "rate": SAMPLE_RATE,
        "samples": len(speech.waveform),
        "data": base64.b64encode(buffer.getvalue()).decode("ascii"),
    }


def encode_phases(labels: Sequence[str], fps: float) -> list[list[Any]]:
    """Frame labels as runs ``[start, end, label]``, seconds."""
    runs: list[list[Any]] = []
    frame = 0
    for label, group in groupby(labels):
        length = sum(1 for _ in group)
        runs.append([frame / fps, (frame + length) / fps, str(label)])
        frame += length
    return runs


def encode_tracks(
    tracks: Mapping[str, Motion], phases: Mapping[str, Sequence[str]]
) -> list[dict[str, Any]]:
    """Skeletons' motions with what is needed to draw them.

    Raises:
        CospeechError: A motion is empty or not finite, or the number of phase labels is not the
            number of frames.
    """
    for name, motion in tracks.items():
        check_drawable(name, motion)
    room = extents(tracks)
    return [
        _encode_track(name, motion, room[name], phases.get(name)) for name, motion in tracks.items()
    ]


def _encode_track(
    name: str, motion: Motion, extent: Extent, phases: Sequence[str] | None
) -> dict[str, Any]:
    if phases is not None and len(phases) != len(motion):
        raise CospeechError(
            f"track {name!r}: {len(phases)} phase labels for {len(motion)} frames",
            "give one label per frame of that track",
        )
    figure = figure_of(motion)
    skull = figure.skull
    return {
        "name": name,
        "fps": float(motion.fps),
        "frames": len(motion),
        "joints": len(motion.skeleton),
        "limbs": [
            [limb.upper, limb.lower, PARTS.index(limb.part), round(limb.radius, 4)]
            for limb in figure.limbs
        ],
        "balls": [
            [ball.point, PARTS.index(ball.part), round(ball.radius, 4)] for ball in figure.balls
        ],
        "skull": None if skull is None else [skull.below, skull.above, skull.place],
        "wrists": wrists(motion.skeleton),
        "yaw": facing(motion),
        "floor": extent.floor,
        "height": extent.height,
        "phases": None if phases is None else encode_phases(phases, motion.fps),
        **encode_positions(motion.positions),
    }
