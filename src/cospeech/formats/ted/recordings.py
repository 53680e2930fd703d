"""TED clips and cached samples as recordings, in house axes and metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording, WindowList
from cospeech.corpus.source import Dropped
from cospeech.formats.ted import expressive
from cospeech.formats.ted.clip import TedClip, ValueLayoutError, check_poses
from cospeech.formats.ted.filters import PUBLISHED_RULES, WindowRules
from cospeech.formats.ted.samples import TedSample
from cospeech.formats.ted.windows import ClipWindows
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import TED_AXES, UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

SKELETON = Skeleton("ted", UPPER_BODY.joints, UPPER_BODY.parents)

METRES_PER_UNIT = (2.40 / 9) / 0.2
"""Stored poses have a mean bone of 0.2; the nine bones of the published table, in metres, add up to
2.40 (docs/facts/trimodal.md, section 3.1)."""

LICENCE = "TED talks, CC BY-NC-ND"


@dataclass(frozen=True)
class Origin:
    """Where a clip or sample comes from.

    Attributes:
        id: Id of its recording; a clip that is cut appends a number.
        video: The video's name, which stands for the speaker (docs/facts/trimodal.md, section 3.9).
        split: Split of its database.
        place: Database, key and clip, for people.
    """

    id: str
    video: str
    split: str | None
    place: str

    def recording(
        self,
        motion: Motion,
        speech: Speech,
        windows: WindowList | None,
        annotations: dict[str, Any],
        suffix: str = "",
    ) -> Recording:
        """A recording from here."""
        return Recording(
            id=self.id + suffix,
            speaker=self.video,
            speech=speech,
            motion=motion,
            annotations={"video": self.video, **annotations},
            split=self.split,
            source=self.place,
            licence=LICENCE,
            windows=windows,
        )

    def dropped(
        self,
        reason: str,
        kind: str,
        is_fault: bool = False,
        windows: dict[str, int] | None = None,
        words: Iterable[Word] = (),
    ) -> Dropped:
        """That there is no recording from here."""
        said = tuple(word.text for word in words)
        return Dropped(self.id, f"{self.place}: {reason}", kind, is_fault, windows or {}, said)


def house_positions(poses: NDArray[np.floating]) -> NDArray[np.float32]:
    """Ten-joint poses in house axes and metres: ``(..., 10, 3)`` float32."""
    return (poses.astype(np.float64) * (np.array(TED_AXES) * METRES_PER_UNIT)).astype(np.float32)


def clip_recordings(
    clip: TedClip, origin: Origin, rules: WindowRules | None = PUBLISHED_RULES
) -> Iterator[Recording | Dropped]:
    """A clip's recordings: one of ten joints, or the pieces of one of 43.

    Ten-joint motion is at 15 fps, resampled as published. 43-joint motion stays at the video's
    rate, cut where the speaker was not detected, and lists no windows: what the published code
    filters there is not known.

    Args:
        clip: The clip.
        origin: Where it comes from.
        rules: What windows the recording lists; None: any window may be used.

    Raises:
        UnusableClipError: The clip is damaged.
        ValueLayoutError: It has neither 10 nor 43 joints.
    """
    joints = clip.poses.shape[1]
    if joints == len(SKELETON):
        yield _ten_joints(clip, origin, rules)
    elif joints == len(expressive.SKELETON):
        yield from _expressive(clip, origin)
    else:
        raise _unknown_joints(joints)


def _ten_joints(clip: TedClip, origin: Origin, rules: WindowRules | None) -> Recording | Dropped:
    cut = ClipWindows(clip, rules or PUBLISHED_RULES)
    windows = None
    if rules is not None:
        kept, dropped = cut.kept, cut.dropped()
        if not cut.windows:
            length = f"{len(cut)} frames at {rules.fps:g} fps, a window has {rules.frames}"
            return origin.dropped(length, "shorter than a window", words=clip.words)
        if not kept:
            counts = ", ".join(f"{reason} {count}" for reason, count in dropped.items())
            return origin.dropped(
                f"windows left out: {counts}",
                "no window passed the filters",
                windows=dropped,
                words=clip.words,
            )
        windows = WindowList(
            rules.fps,
            rules.frames,
            rules.stride,
            np.array([window.start for window in kept], np.int64),
            np.array([cut.audio_start(window.start) for window in kept], np.int64),
            dropped,
        )
    motion = Motion(SKELETON, cut.rules.fps, house_positions(cut.poses))
    speech = _speech(clip.audio, clip.words, clip.start_s)
    return origin.recording(motion, speech, windows, _whereabouts(clip))


def _expressive(clip: TedClip, origin: Origin) -> Iterator[Recording | Dropped]:
    check_poses(clip)
    fps = clip.native_fps
    shortest = math.ceil(PUBLISHED_RULES.frames / PUBLISHED_RULES.fps * fps)
    positions = expressive.house_positions(clip.poses)
    pieces = list(expressive.whole_pieces(positions, fps, shortest))
    if not pieces:
        reason = f"no {shortest} frames on end with a detected pose, of {len(clip.poses)}"
        yield origin.dropped(reason, "shorter than a window", words=clip.words)
        return
    used = sum(len(poses) for _, poses in pieces)
    if used < len(clip.poses):
        # what is said in the parts cut out belongs to the vocabulary, in the clip's order
        reason = f"{len(clip.poses) - used} of {len(clip.poses)} frames cut out"
        yield origin.dropped(reason, "speaker not detected", words=clip.words)
    for number, (first, poses) in enumerate(pieces):
        start_s, seconds = clip.start_s + first / fps, len(poses) / fps
        sample = round(first / fps * SAMPLE_RATE)
        audio = clip.audio[sample : sample + math.ceil(seconds * SAMPLE_RATE)]
        words = [w for w in clip.words if w.end > start_s and w.start < start_s + seconds]
        yield origin.recording(
            Motion(expressive.SKELETON, fps, poses),
            _speech(audio, words, start_s),
            None,
            {**_whereabouts(clip), "first_frame_in_clip": first},
            "" if len(pieces) == 1 else f"-{number}",
        )


def sample_recording(sample: TedSample, origin: Origin) -> Recording:
    """A cached sample as a recording whose only window is all of it.

    Raises:
        UnusableClipError: Its bones have no length.
        ValueLayoutError: It has neither 10 nor 43 joints.
    """
    poses, fps = sample.poses, PUBLISHED_RULES.fps
    if poses.shape[1] == len(SKELETON):
        motion = Motion(SKELETON, fps, house_positions(poses))
    elif poses.shape[1] == len(expressive.SKELETON):
        motion = Motion(expressive.SKELETON, fps, expressive.house_positions(poses))
    else:
        raise _unknown_joints(poses.shape[1])
    first = np.zeros(1, np.int64)
    start_s = sample.aux["start_time"]
    return origin.recording(
        motion,
        _speech(sample.audio, sample.words, start_s),
        WindowList(fps, len(motion), PUBLISHED_RULES.stride, first, first),
        {"start_s": start_s},
    )


def _whereabouts(clip: TedClip) -> dict[str, Any]:
    return {"start_s": clip.start_s, "end_s": clip.end_s, "start_frame": clip.start_frame}


def _speech(audio: NDArray[np.floating], words: Iterable[Word], start_s: float) -> Speech:
    """On the clip's own clock; a word that began before the clip has a negative start."""
    moved = tuple(Word(word.text, word.start - start_s, word.end - start_s) for word in words)
    return Speech(audio.astype(np.float32), moved)


def _unknown_joints(count: int) -> ValueLayoutError:
    return ValueLayoutError(
        f"{count} joints a frame; the TED set has {len(SKELETON)}, TED-Expressive"
        f" {len(expressive.SKELETON)}"
    )
