"""Small corpora made for tests, with content that can be checked by hand."""

import numpy as np

from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

REST_POSE = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.6, 0.1],
        [0.0, 0.75, 0.05],
        [0.2, 0.45, 0.0],
        [0.25, 0.2, 0.0],
        [0.25, 0.1, 0.2],
        [-0.2, 0.45, 0.0],
        [-0.25, 0.2, 0.0],
        [-0.25, 0.1, 0.2],
    ],
    dtype=np.float32,
)


def make_recording(
    name: str,
    speaker: str = "ada",
    seconds: float = 10.0,
    words: tuple[Word, ...] | None = None,
    seed: int = 0,
    phases: bool = False,
) -> Recording:
    """Wrists circling at a rate drawn from the seed; audio whose sample i is i / 16000 % 1."""
    rng = np.random.default_rng(seed)
    frames = round(seconds * 15)
    times = np.arange(frames) / 15
    positions = np.repeat(REST_POSE[None], frames, axis=0)
    for joint, side in ((6, 1.0), (9, -1.0)):
        rate, phase = rng.uniform(0.3, 0.9), rng.uniform(0, 2 * np.pi)
        positions[:, joint, 0] += 0.15 * side * np.sin(2 * np.pi * rate * times + phase)
        positions[:, joint, 1] += 0.2 * np.cos(2 * np.pi * rate * times + phase)
    audio = (np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE % 1).astype(np.float32)
    if words is None:
        words = tuple(
            Word(text, float(start), float(start) + 0.3)
            for start, text in zip(
                np.arange(0.2, seconds - 0.5, 0.5), 40 * ["one", "two", "three"], strict=False
            )
        )
    motion = Motion(UPPER_BODY, 15.0, positions)
    labels = (np.arange(frames) // 8 % 9).astype(np.int8) if phases else None
    return Recording(
        name,
        speaker,
        Speech(audio, words),
        motion,
        phases=labels,
        source="made",
        licence="none",
    )


def make_store(folder, recordings: list[Recording] | None = None) -> Store:
    """A store of six recordings of two speakers: four train, one validates, one tests."""
    if recordings is None:
        recordings = [
            make_recording(f"take{i}", speaker=("ada", "ben")[i % 2], seed=i) for i in range(6)
        ]
    with StoreWriter(folder / "made", "made", {"made": True}, "0" * 64) as writer:
        for recording in recordings:
            writer.add(recording)
        frames = writer.columns()["frames"]
        names = ["train"] * (len(frames) - 2) + ["val", "test"]
        spans = {
            split: [Span(i, 0, frames[i]) for i, name in enumerate(names) if name == split]
            for split in SPLITS
        }
        return writer.finish(spans)
