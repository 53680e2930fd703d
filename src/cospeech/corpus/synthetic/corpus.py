"""The embedded corpus, take by take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import asdict
from functools import partial
from itertools import islice

import numpy as np

from cospeech.corpus.recording import Recording
from cospeech.corpus.synthetic.body import keep_clear, pose_body
from cospeech.corpus.synthetic.gesturer import amplitudes, plan_hands, stroke_extents
from cospeech.corpus.synthetic.outlines import LEFT, RIGHT
from cospeech.corpus.synthetic.phrasing import (
    fill_phases,
    find_causes,
    place_strokes,
)
from cospeech.corpus.synthetic.posture import hand_tremor, make_posture
from cospeech.corpus.synthetic.skeleton import SKELETON
from cospeech.corpus.synthetic.speakers import REST_POSTURES
from cospeech.corpus.synthetic.takes import (
    BODY_STREAM,
    FORM_STREAM,
    PHRASING_STREAM,
    TakePlan,
    assemble,
    plan,
)
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PhaseSegment, frame_phases
from cospeech.processes import in_order
from cospeech.speech.tts import Utterance, speak_all

GENERATOR_VERSION = "1"
"""Changes whenever the same seed gives other bytes; part of a store's fingerprint."""

_HANDS = {(True, False): "left", (False, True): "right", (True, True): "both"}


def build_take(take: TakePlan, utterances: list[Utterance], fps: float = 60) -> Recording:
    """Gestures to a spoken take.

    Depends on its arguments alone, so takes may be built in any order and any process.

    Args:
        take: The plan.
        utterances: Its lines, spoken (`cospeech.speech.tts.speak_all`).
        fps: Frames per second; the motion is the same function of time at every rate.

    Returns:
        A recording with audio, words, positions, rotations and phase labels. ``annotations`` holds
        the truth: ``style``, ``voice``, ``rest``, ``gestures`` (kind, hand, word and its index, the
        stressed syllable's onset ``cause_time``, ``stroke_start``, ``stroke_end`` and
        ``amplitude_m``; an ``independent_hold`` has its pose's start and end instead),
        ``sentences`` (text, start, end, arousal) and ``phonemes`` (symbol, start, end, stress).

    Raises:
        ValueError: ``fps`` is not positive, or the utterances are not the take's lines.
    """
    if not fps > 0:
        raise ValueError(f"fps must be positive, got {fps}")
    spoken = assemble(take, utterances)
    style = take.speaker.style
    rng = take.rng(PHRASING_STREAM)
    causes = find_causes(spoken, style, rng)
    gestures, phases = fill_phases(place_strokes(causes, spoken, style, rng), spoken, style, rng)
    words = [spoken.words[gesture.cause.word].text for gesture in gestures]
    paths, forms = plan_hands(
        gestures, phases, amplitudes(take, spoken, gestures), words, style, take.rng(FORM_STREAM)
    )
    frames = round(spoken.speech.duration * fps)
    times = np.arange(frames) / fps
    body_rng = take.rng(BODY_STREAM)
    hands = keep_clear(paths.at(times) + hand_tremor(times, body_rng))
    posture = make_posture(times, hands, take, spoken, gestures, body_rng)
    positions, rotations = pose_body(hands, posture)
    extents = stroke_extents(paths, gestures, forms)
    annotations = {
        "style": asdict(style),
        "voice": asdict(take.speaker.voice),
        "rest": REST_POSTURES[style.rest],
        "gestures": [
            {
                "kind": gesture.cause.concept,
                "hand": _HANDS[form.hands[LEFT], form.hands[RIGHT]],
                "word_index": gesture.cause.word,
                "word": word,
                "cause_time": gesture.cause.time,
                "stroke_start": gesture.start,
                "stroke_end": gesture.end,
                "amplitude_m": round(extent, 4),
            }
            for gesture, form, word, extent in zip(gestures, forms, words, extents, strict=True)
        ],
        "sentences": [
            [
                line.sentence.text,
                round(float(start), 6),
                round(float(end), 6),
                round(line.arousal, 3),
            ]
            for line, start, end in zip(
                take.lines, spoken.line_starts, spoken.line_ends, strict=True
            )
        ],
        "phonemes": [
            [phoneme.symbol, round(phoneme.start, 4), round(phoneme.end, 4), phoneme.stress]
            for phoneme in spoken.phonemes
        ],
    }
    return Recording(
        id=take.id,
        speaker=take.speaker.name,
        speech=spoken.speech,
        motion=Motion(SKELETON, fps, positions.astype(np.float32), rotations.astype(np.float32)),
        phases=frame_phases(
            [PhaseSegment(phase.start, phase.end, phase.label) for phase in phases], frames, fps
        ),
        annotations=annotations,
        source=f"cospeech synthetic corpus v{GENERATOR_VERSION}, seed {take.seed}",
        licence="MIT",
    )


def synthesise(
    minutes: float = 60,
    seed: int = 0,
    speakers: int = 16,
    fps: float = 60,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Recording]:
    """The embedded corpus: real synthesised speech with gestures whose causes are known.

    The same arguments give the same bytes, whatever the number of workers. All lines are spoken, in
    order, by one fresh espeak-ng process, which runs while the motion of earlier takes is built.

    Args:
        minutes: Length of the corpus; one hour is 48 takes.
        seed: Of every choice.
        speakers: Size of the cast.
        fps: Frames per second; the default 60 gives 30, 20 and 15 by leaving frames out.
        workers: Processes that build motion; 1 builds it in this one.
        progress: Called with the number of takes done and their total after each take.

    Yields:
        Recordings in the order of `cospeech.corpus.synthetic.plan`.

    Raises:
        CospeechError: The extra ``tts`` is missing.
        ValueError: An argument is out of range.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    takes = plan(minutes, seed, speakers)
    recordings = _in_order(takes, fps, workers)
    for done, recording in enumerate(recordings, start=1):
        yield recording
        if progress is not None:
            progress(done, len(takes))


def _in_order(takes: list[TakePlan], fps: float, workers: int) -> Iterator[Recording]:
    utterances = speak_all(
        [(line.sentence.text, line.voice) for take in takes for line in take.lines]
    )
    spoken = ((take, list(islice(utterances, len(take.lines)))) for take in takes)
    with closing(in_order(partial(_build, fps=fps), spoken, workers)) as recordings:
        yield from recordings


def _build(spoken: tuple[TakePlan, list[Utterance]], fps: float) -> Recording:
    return build_take(*spoken, fps)
