"""Stretches of a corpus as motion matching sees them: positions, sound, phases of each frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import CospeechError
from cospeech.matching.features import SearchJoints, search_joints
from cospeech.motion.interleaves import at_a_multiple
from cospeech.motion.joint_map import EVALUATION_JOINTS
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.motion.velocities import BodyJoints, body_positions
from cospeech.progress import progress_bar
from cospeech.speech.feature_sets.sphinx import sphinx_features
from cospeech.speech.speech import SAMPLE_RATE

HEAD_ROLES = ("nose", "head")
"""What a pose holds beside the gesturing joints, so that the evaluation's joints are complete."""


@dataclass(frozen=True, eq=False)
class Track:
    """One span at a database's rate.

    Attributes:
        span: Where it is in the corpus.
        start_s: Time of the first frame in the recording, s.
        search: ``(F, C)`` positions that are compared, metres.
        poses: ``(F, J, 3)`` positions that are put out, in the body frame, metres.
        audio: ``(F, 14)``, not normalised.
        phases: ``(F,)`` int8 indices into `cospeech.motion.phases.PHASES`; -1 where unknown.
    """

    span: Span
    start_s: float
    search: NDArray[np.float32]
    poses: NDArray[np.float32]
    audio: NDArray[np.float32]
    phases: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.poses)


class Tracks:
    """The tracks of one split, read one by one.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        fps: Frames per second.

    Raises:
        CospeechError: No joint map fits, or the skeletons have different gesturing joints.
        ConfigError: No recording of the split has sound.
    """

    def __init__(self, store: Store, split: str, fps: float) -> None:
        self.store, self.split, self.fps = store, split, fps
        self.spans: Sequence[Span] = store.spans_with_sound(
            store.splits[split], f"{split} motion to match"
        )
        self._joints = {
            index: search_joints(store.skeletons[index])
            for index in sorted({store.recordings[span.recording].skeleton for span in self.spans})
        }
        different = {
            role
            for joints in self._joints.values()
            for role in set(joints.gesture.roles) ^ set(self.joints.gesture.roles)
        }
        if different:
            raise CospeechError(
                f"{store.name}: its recordings have different gesturing joints"
                f" ({', '.join(sorted(different))})",
                "prepare those with and without fingers as two corpora",
            )

    def __iter__(self) -> Iterator[Track]:
        for span in progress_bar(self.spans, len(self.spans), f"{self.split} motion to match"):
            yield self._track(span)

    @property
    def joints(self) -> SearchJoints:
        """The joints, by the names of the first skeleton."""
        return next(iter(self._joints.values()))

    @cached_property
    def pose_roles(self) -> tuple[str, ...]:
        """What the J joints of a pose are."""
        return (*self.joints.gesture.roles, *HEAD_ROLES)

    @cached_property
    def evaluation_roles(self) -> tuple[str, ...]:
        """Which roles are the ten joints of the evaluation, in its order."""
        gesture = self.joints.gesture
        spine = gesture.roles[gesture.evaluation_spine]
        return tuple(spine if name == "spine" else name for name in EVALUATION_JOINTS)

    def _track(self, span: Span) -> Track:
        store, fps = self.store, self.fps
        joints = self._joints[store.recordings[span.recording].skeleton]
        motion = store.motion(span.recording)
        first = math.ceil(span.start / EVALUATION_FPS * motion.fps - 1e-6)
        stop = len(motion)
        if span.stop < store.recordings[span.recording].frames:
            stop = min(stop, math.ceil(span.stop / EVALUATION_FPS * motion.fps - 1e-6))
        body = joints.gesture.body
        both = BodyJoints((*joints.joints, *body.joints), body.reference, body.sideways)
        positions = body_positions(motion.slice(first, stop), both)
        positions, multiple = at_a_multiple(positions, motion.fps, fps)
        positions = positions[::multiple]
        start_s, count = first / motion.fps, len(positions)
        searched, gesture = np.split(positions, [len(joints.joints)], axis=1)
        times_s = start_s + np.arange(count) / fps
        neck = gesture[:, joints.gesture.roles.index("neck"), None]
        # Audio of another split isn't looked at, so a span's last frames hear its audio repeated.
        samples = store.read(
            span.recording,
            "audio",
            round(start_s * SAMPLE_RATE),
            round(stop / motion.fps * SAMPLE_RATE),
        )
        phases = np.full(count, -1, dtype=np.int8)
        labels = store.phases(span.recording)
        if labels is not None:
            phases = labels[np.rint(times_s * motion.fps).astype(int).clip(max=len(labels) - 1)]
        return Track(
            span,
            start_s,
            searched.reshape(count, -1),
            np.concatenate([gesture, neck + self._head(span, times_s)], axis=1),
            sphinx_features(samples[:, 0] * np.float32(1 / 32767), fps, count),
            phases,
        )

    def _head(self, span: Span, times_s: NDArray[np.float64]) -> NDArray[np.float32]:
        """``(F, 2, 3)`` nose and head relative to the neck, between stored frames linearly."""
        upper = np.array(self.store.upper_body(span.recording, span.start, span.stop))
        neck, *head = (UPPER_BODY.index[name] for name in ("neck", *HEAD_ROLES))
        offsets = upper[:, head] - upper[:, [neck]]
        places = (times_s * EVALUATION_FPS - span.start).clip(0, len(offsets) - 1)
        low = places.astype(int)
        high = np.minimum(low + 1, len(offsets) - 1)
        share = (places - low).astype(np.float32)[:, None, None]
        between: NDArray[np.float32] = offsets[low] + share * (offsets[high] - offsets[low])
        return between
