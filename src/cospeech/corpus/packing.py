"""A recording as the bytes a store keeps: the part of preparing that runs in many processes.

Nothing here imports torch, so that a worker process starts in a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped, Source
from cospeech.errors import CospeechError
from cospeech.motion.joint_map import find_joint_map
from cospeech.motion.motion import resample_positions
from cospeech.motion.upper_body import EVALUATION_FPS, to_upper_body
from cospeech.speech.speech import Speech, Word
from cospeech.speech.vocabulary import normalise_word

STREAMS: dict[str, tuple[str, int]] = {
    "positions": ("<f4", 3),
    "rotations_local": ("<f4", 4),
    "rest_offsets": ("<f8", 3),
    "upper_body": ("<f4", 30),
    "audio": ("<i2", 1),
    "words": ("<f8", 3),
    "phases": ("|i1", 1),
    "interlocutor_audio": ("<i2", 1),
    "interlocutor_words": ("<f8", 3),
    "windows": ("<i8", 2),
}
"""Stream name -> (dtype, numbers per row). A row of `positions` is one joint of one frame (of two
numbers in a corpus of 2-D keypoints), as is one of `rotations_local`; one of `rest_offsets` a joint
of the recording's own skeleton; one of `windows` a start frame and a start sample."""


@dataclass(frozen=True)
class PackedRecording:
    """A recording ready to be appended to a store's streams.

    Attributes:
        facts: What the manifest says of it, as JSON values.
        skeleton: `Skeleton.to_dict` of its skeleton.
        texts: Every row of ``words``, as the vocabulary spells it.
        interlocutor_texts: Text of every row of ``interlocutor_words``.
        annotations: Whatever else is known.
        rows: Stream name -> number of rows.
        data: Stream name -> their bytes; a stream without rows is left out.
        remarks: (kind, advice) of each `Remark`.
    """

    facts: dict[str, Any]
    skeleton: dict[str, Any]
    texts: list[str]
    interlocutor_texts: list[str]
    annotations: dict[str, Any]
    rows: dict[str, int]
    data: dict[str, bytes]
    remarks: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class PackedSource:
    """Everything that came out of one source.

    Attributes:
        id: The source's id.
        recordings: In the source's order.
        dropped: What was left out; a source that could not be read is one entry of its own.
        texts: The distinct words of it all, in order of first appearance.
    """

    id: str
    recordings: list[PackedRecording]
    dropped: list[Dropped] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def faults(self) -> list[Dropped]:
        """What was left out because it is damaged."""
        return [dropped for dropped in self.dropped if dropped.is_fault]


def pack_source(source: Source, upper_body: bool) -> PackedSource:
    """Read a source and pack its recordings; what can't be used is noted, never raised.

    Whatever error comes up, expected or not, costs the recording or the rest of the source.

    Args:
        source: The source.
        upper_body: Whether the corpus has the ten evaluation joints.
    """
    recordings: list[PackedRecording] = []
    dropped: list[Dropped] = []
    texts: dict[str, None] = {}
    try:
        for item in source.read():
            if isinstance(item, Dropped):
                dropped.append(item)
                texts |= dict.fromkeys(filter(None, map(normalise_word, item.words)))
                continue
            try:
                recordings.append(pack(item, upper_body))
            except Exception as error:
                words = tuple(word.text for word in item.speech.words or ())
                dropped.append(Dropped.fault(item.id, error, "unusable motion", words))
                texts |= dict.fromkeys(filter(None, map(normalise_word, words)))
            else:
                texts |= dict.fromkeys(recordings[-1].texts)
                texts |= dict.fromkeys(recordings[-1].interlocutor_texts)
    except Exception as error:
        dropped.append(Dropped.fault(source.id, error))
    return PackedSource(source.id, recordings, dropped, list(texts))


def pack(recording: Recording, upper_body: bool = True) -> PackedRecording:
    """Turn a recording into the store's streams.

    Raises:
        CospeechError: The motion holds NaN, or its joints have no map to the upper body.
    """
    motion, windows = recording.motion, recording.windows
    bad = motion.first_bad_frame()
    if bad is not None:
        joint = int((~np.isfinite(motion.positions[bad])).any(axis=1).argmax())
        raise CospeechError(
            f"recording {recording.id}: NaN or infinite position at frame {bad},"
            f" joint {motion.skeleton.joints[joint]}"
        )
    if motion.rotations_local is not None and not np.isfinite(motion.rotations_local).all():
        frame, joint, _ = np.argwhere(~np.isfinite(motion.rotations_local))[0]
        raise CospeechError(
            f"recording {recording.id}: NaN or infinite rotation at frame {frame},"
            f" joint {motion.skeleton.joints[joint]}"
        )
    if windows is not None and windows.fps != EVALUATION_FPS and upper_body:
        raise ValueError(f"a window list at {windows.fps} fps")
    if windows is not None and not len(windows.starts):
        raise ValueError("an empty window list: without rows a recording gives every window")
    words, texts = _words(recording.speech)
    other_words, other_texts = _words(recording.interlocutor)
    arrays: dict[str, NDArray[Any]] = {
        "positions": motion.positions.reshape(-1, motion.dimensions),
        "audio": _quantised(recording.speech),
        "words": words,
        "interlocutor_audio": _quantised(recording.interlocutor),
        "interlocutor_words": other_words,
    }
    skeleton = motion.skeleton
    if upper_body:
        chosen = find_joint_map(skeleton)
        skeleton = replace(skeleton, joint_map=chosen)
        upper = to_upper_body(motion, chosen).positions
        resampled = resample_positions(upper, motion.fps, EVALUATION_FPS)
        arrays["upper_body"] = resampled.reshape(-1, 30)
    if motion.rotations_local is not None:
        arrays["rotations_local"] = motion.rotations_local.reshape(-1, 4)
        if skeleton.offsets is not None:
            arrays["rest_offsets"] = skeleton.offsets
    if recording.phases is not None:
        arrays["phases"] = np.asarray(recording.phases)[:, None]
    if windows is not None:
        arrays["windows"] = np.stack([windows.starts, windows.audio_starts], axis=1)
    frames = int(np.floor((len(motion) - 1) / motion.fps * EVALUATION_FPS + 1e-6)) + 1
    return PackedRecording(
        facts={
            "id": recording.id,
            "speaker": recording.speaker,
            "fps": motion.fps,
            "frames": frames if len(motion) else 0,
            "dimensions": motion.dimensions,
            "split": recording.split,
            "has_words": recording.speech.words is not None,
            "has_audio": len(recording.speech.waveform) > 0,
            "has_phases": recording.phases is not None,
            "has_rotations": motion.rotations_local is not None,
            "has_interlocutor": recording.interlocutor is not None,
            "source": recording.source,
            "licence": recording.licence,
            "window_grid": None
            if windows is None
            else {"fps": windows.fps, "frames": windows.frames, "stride": windows.stride},
            "dropped_windows": {} if windows is None else dict(windows.dropped),
        },
        skeleton=skeleton.to_dict(),
        texts=texts,
        interlocutor_texts=other_texts,
        annotations={"id": recording.id, **recording.annotations},
        rows={stream: len(arrays.get(stream, ())) for stream in STREAMS},
        data={
            stream: np.ascontiguousarray(array, dtype=STREAMS[stream][0]).tobytes()
            for stream, array in arrays.items()
            if len(array)
        },
        remarks=[(remark.kind, remark.advice) for remark in recording.remarks],
    )


def journal_entry(source: PackedSource, skeletons: Sequence[int]) -> dict[str, Any]:
    """What a build notes of a source once its bytes are written.

    Args:
        source: What was appended.
        skeletons: Index of each recording's skeleton in the store.
    """
    return {
        "source": source.id,
        "dropped": [
            {k: v for k, v in asdict(dropped).items() if k not in ("words", "trace")}
            for dropped in source.dropped
        ],
        "texts": source.texts,
        "recordings": [
            {
                "facts": {**packed.facts, "skeleton": skeleton},
                "rows": packed.rows,
                "remarks": packed.remarks,
            }
            for packed, skeleton in zip(source.recordings, skeletons, strict=True)
        ],
    }


def _words(speech: Speech | None) -> tuple[NDArray[np.float64], list[str]]:
    # A token without a letter or digit is no word (docs/facts/trimodal.md, section 3.4: empty words
    # are skipped).
    words: Sequence[Word] = () if speech is None else speech.words or ()
    # Windows are found by bisection: a transcript out of order would lose words without a trace.
    words = sorted(words, key=lambda word: word.start)
    spelt = [(word, text) for word in words if (text := normalise_word(word.text))]
    rows = np.array([(word.start, word.end, -1.0) for word, _ in spelt], dtype=np.float64)
    return rows.reshape(-1, 3), [text for _, text in spelt]


def _quantised(speech: Speech | None) -> NDArray[np.int16]:
    if speech is None:
        return np.zeros((0, 1), dtype=np.int16)
    return np.rint(np.clip(speech.waveform, -1, 1) * 32767).astype(np.int16)[:, None]
