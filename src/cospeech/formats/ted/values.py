"""Decoded values of the TED databases, checked: nothing in them is taken for granted."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.formats.ted.clip import TedClip, UnusableClipError, ValueLayoutError
from cospeech.formats.ted.samples import TedSample
from cospeech.speech.speech import Word


def video_clips(value: Any) -> tuple[str, list[Any]]:
    """Name and clips of a value of a video database; the clips are not looked into.

    See docs/facts/trimodal.md, section 3.4.

    Raises:
        ValueLayoutError: It isn't a video.
    """
    if isinstance(value, list):
        raise ValueLayoutError(
            "holds a list where a video is a dictionary: this looks like a cache database"
        )
    if not isinstance(value, dict) or not {"vid", "clips"} <= set(value):
        raise ValueLayoutError("holds no dictionary with 'vid' and 'clips'")
    if not isinstance(value["vid"], str) or not isinstance(value["clips"], list):
        raise ValueLayoutError("'vid' is no text, or 'clips' is no list")
    return value["vid"], value["clips"]


def checked_clip(values: Any) -> TedClip:
    """One item of ``clips``.

    Raises:
        UnusableClipError: It lacks an entry, or one has another type or shape.
    """
    if not isinstance(values, dict):
        raise UnusableClipError("damaged", "the clip is no dictionary")
    wanted = ("words", "skeletons_3d", "audio_feat", "audio_raw", "start_time", "end_time")
    if missing := [name for name in wanted if name not in values]:
        raise UnusableClipError("damaged", f"the clip has no {', '.join(missing)}")
    start_frame = values.get("start_frame_no", 0)
    return TedClip(
        words=checked_words(values["words"]),
        poses=_poses(values["skeletons_3d"]),
        spectrogram=_array(values["audio_feat"], "audio_feat", 2),
        audio=_audio(values["audio_raw"]),
        start_frame=start_frame if isinstance(start_frame, int) else 0,
        start_s=_seconds(values["start_time"], "start_time"),
        end_s=_seconds(values["end_time"], "end_time"),
    )


def checked_sample(value: Any) -> TedSample:
    """A value of a cache database (docs/facts/trimodal.md, section 3.6, step 7).

    Raises:
        ValueLayoutError: It isn't a cached sample.
        UnusableClipError: It is one, with an entry of another type or shape.
    """
    if isinstance(value, dict) and "clips" in value:
        raise ValueLayoutError("holds a video where a cached sample is a list of six")
    if not isinstance(value, list | tuple) or len(value) != 6 or not isinstance(value[5], dict):
        raise ValueLayoutError(
            "holds no list of words, poses, direction vectors, audio, spectrogram and a dictionary"
        )
    words, poses, directions, audio, spectrogram, aux = value
    if not isinstance(aux.get("vid"), str):
        raise UnusableClipError("damaged", "the sample has no 'vid'")
    poses = _poses(poses)
    if not np.isfinite(poses).all():
        raise UnusableClipError("pose not a number", "a pose holds a NaN or infinite coordinate")
    start_s = _seconds(aux.get("start_time"), "start_time")
    directions = _array(directions, "direction vectors", None)
    if directions.shape[:1] != poses.shape[:1]:
        raise UnusableClipError(
            "damaged", f"poses of shape {poses.shape}, direction vectors {directions.shape}"
        )
    return TedSample(
        words=checked_words(words),
        poses=poses.astype(np.float64),
        directions=directions.astype(np.float64),
        audio=_audio(audio),
        spectrogram=_array(spectrogram, "spectrogram", 2),
        aux={**aux, "start_time": start_s},
    )


def checked_words(values: Any) -> tuple[Word, ...]:
    """Words in order of onset.

    Raises:
        UnusableClipError: They aren't a list of [text, start, end].
    """
    words = []
    for item in values if isinstance(values, list | tuple) else [None]:
        match item:
            case [str(text), (int() | float()) as start, (int() | float()) as end]:
                words.append(Word(text, _seconds(start, "a word"), _seconds(end, "a word")))
            case _:
                raise UnusableClipError("damaged", "'words' is no list of [text, start, end]")
    return tuple(sorted(words, key=lambda word: word.start))


def words_of(values: Any) -> tuple[Word, ...]:
    """Words of a clip that can't be used, as far as they can be read; never raises."""
    try:
        return checked_words(values["words"]) if isinstance(values, dict) else ()
    except (UnusableClipError, KeyError):
        return ()


def _seconds(value: Any, name: str) -> float:
    if not isinstance(value, int | float) or not abs(value) < 1e9:
        raise UnusableClipError("damaged", f"{name}: {value!r} is no time in seconds")
    return float(value)


def _array(value: Any, name: str, dimensions: int | None) -> NDArray[np.floating]:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        raise UnusableClipError("damaged", f"{name} is no array of numbers")
    if dimensions is not None and value.ndim != dimensions:
        raise UnusableClipError("damaged", f"{name} has the shape {value.shape}")
    return value if value.dtype.kind == "f" else value.astype(np.float64)


def _audio(value: Any) -> NDArray[np.floating]:
    audio = _array(value, "audio", 1)
    if not len(audio):
        raise UnusableClipError("no audio", "the audio holds no sample")
    finite = np.isfinite(audio)
    if not finite.all():
        raise UnusableClipError("audio not a number", f"sample {finite.argmin()} is no number")
    return audio


def _poses(value: Any) -> NDArray[np.floating]:
    if isinstance(value, list) and value:
        value = _stacked(value)
    poses = _array(value, "poses", 3)
    if poses.shape[2] != 3:
        raise UnusableClipError("damaged", f"poses have the shape {poses.shape}")
    return poses


def _stacked(frames: Iterable[Any]) -> NDArray[np.floating]:
    """Frames that are arrays of their own, as TED-Expressive has them."""
    arrays = [_array(frame, "a pose", 2) for frame in frames]
    if len({array.shape for array in arrays}) > 1:
        raise UnusableClipError("damaged", "poses of one clip have different shapes")
    return np.stack(arrays)
