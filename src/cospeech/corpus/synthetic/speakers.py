"""The simulated speakers: a voice and a gesture style each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cospeech.speech.tts import Voice

_VOICES: tuple[tuple[str, int], ...] = (
    ("en-us+f3", 55),
    ("en-us+m3", 45),
    ("en+f2", 50),
    ("en+m1", 55),
    ("en-us+Andrea", 50),
    ("en-us+Michael", 50),
    ("en-gb-scotland+f4", 45),
    ("en-gb-scotland+m7", 50),
    ("en-us+Alicia", 45),
    ("en-us+Mike", 50),
    ("en+Annie", 50),
    ("en+Lee", 55),
    ("en-us+f5", 40),
    ("en-us+m8", 60),
    ("en-us+linda", 50),
    ("en+m4", 40),
)
"""Voice and base pitch, women and men in turn."""

REST_POSTURES: tuple[str, ...] = ("sides", "clasped", "belly")
"""Where the hands rest: hanging, folded low in front, or loosely at the belly."""


@dataclass(frozen=True)
class Style:
    """How a speaker gestures.

    Attributes:
        amplitude: Size of strokes, relative to the average speaker.
        rate: Strokes per minute wanted while speaking.
        tempo: Duration of preparations, strokes and retractions, relative to the average.
        hold: Length of holds, relative to the average.
        lead: Mean time from stroke onset to the stressed syllable, s.
        right_share: Share of one-handed gestures made with the right hand.
        two_handed: Share of beats made with both hands.
        chain: Tendency to go on without a new preparation, relative to the average.
        rest: Index into `REST_POSTURES`.
        height: Of the gesture space above the average, m.
        width: Of the gesture space beyond the average, m per hand.
        elbow: How far the elbows point outwards; 0 hangs, 1 is straight out.
        palm: Habitual pronation of the forearm, rad; positive turns the palm down.
        curl: Habitual bend of each finger joint, rad.
        sway: Size of posture sway, relative to the average.
        nod: Share of strokes that come with a head nod.
        hand_lag: Time by which the weaker hand trails, s.
    """

    amplitude: float
    rate: float
    tempo: float
    hold: float
    lead: float
    right_share: float
    two_handed: float
    chain: float
    rest: int
    height: float
    width: float
    elbow: float
    palm: float
    curl: float
    sway: float
    nod: float
    hand_lag: float


@dataclass(frozen=True)
class Speaker:
    """A simulated person.

    Attributes:
        name: Unique in the corpus.
        voice: Habitual voice; every sentence varies it a little.
        style: Gesture style.
    """

    name: str
    voice: Voice
    style: Style


_RANGES: dict[str, tuple[float, float]] = {
    "amplitude": (0.7, 1.35),
    "rate": (33.0, 44.0),
    "tempo": (0.88, 1.12),
    "hold": (0.85, 1.15),
    "lead": (0.16, 0.24),
    "two_handed": (0.15, 0.6),
    "chain": (0.8, 1.2),
    "height": (-0.05, 0.06),
    "width": (-0.03, 0.05),
    "elbow": (0.15, 0.6),
    "palm": (-0.4, 0.7),
    "curl": (0.15, 0.5),
    "sway": (0.6, 1.5),
    "nod": (0.25, 0.85),
    "hand_lag": (0.0, 0.05),
}


def cast(count: int, seed: int) -> list[Speaker]:
    """The speakers of a corpus.

    Every style parameter is spread evenly over its range and dealt out at random (a Latin
    hypercube), so that the corpus means don't depend on the seed.

    Args:
        count: Speakers wanted; beyond 16 the voices return with another pitch and rate.
        seed: Seed of the corpus.

    Raises:
        ValueError: ``count`` is below 1.
    """
    if count < 1:
        raise ValueError(f"a corpus needs at least one speaker, got {count}")
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    dealt = {
        name: low + (high - low) * (rng.permutation(count) + rng.uniform(size=count)) / count
        for name, (low, high) in _RANGES.items()
    }
    # nine in ten people are right-handed; even they use the left hand for a third of their gestures
    right_share = np.where(rng.permutation(count) < round(0.1 * count), 0.3, 0.72)
    right_share += rng.uniform(-0.12, 0.12, size=count)
    rest = rng.permutation(np.arange(count) % len(REST_POSTURES))
    rates = 125 + 45 * (rng.permutation(count) + 0.5) / count
    speakers = []
    for i in range(count):
        name, pitch = _VOICES[i % len(_VOICES)]
        shift = 12 * (i // len(_VOICES)) * (-1 if i % 2 else 1)
        voice = Voice(
            name=name,
            rate=round(float(rates[i])),
            pitch=int(np.clip(pitch + shift + rng.integers(-4, 5), 5, 95)),
            pitch_range=int(rng.integers(45, 75)),
            volume=int(rng.integers(90, 106)),
        )
        style = Style(
            right_share=float(right_share[i]),
            rest=int(rest[i]),
            **{key: float(values[i]) for key, values in dealt.items()},
        )
        speakers.append(Speaker(f"s{i + 1:02d}", voice, style))
    return speakers
