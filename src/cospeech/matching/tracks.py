"""Stretches of a corpus as motion matching sees them: positions, sound, phases of each frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import CEPSTRA
from cospeech.corpus.features.field import MotionField
from cospeech.corpus.features.joints import PHASES, POSES, pose_roles
from cospeech.corpus.features.span_motion import SpanMotion
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.tracks import Tracks
from cospeech.matching.features import SearchJoints, search_joints
from cospeech.motion.joint_map import EVALUATION_JOINTS
from cospeech.motion.velocities import BodyJoints
from cospeech.speech.feature_sets.sphinx import STATIC_CHANNELS


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


def _search(motion: SpanMotion) -> NDArray[np.float32]:
    joints = search_joints(motion.motion.skeleton)
    body = joints.gesture.body
    return motion.joints(BodyJoints(joints.joints, body.reference, body.sideways))


_SEARCH = MotionField(
    name="search", reads="upper body", width=None, unit="metres", of_motion=_search
)


class MatchingTracks:
    """The tracks of one split, one per span.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        fps: Frames per second.

    Raises:
        CospeechError: No joint map fits, or the skeletons have different gesturing joints.
        ConfigError: No recording of the split has sound.
    """

    def __init__(self, store: Store, split: str, fps: float) -> None:
        what = f"{split} motion to match"
        self.spans = store.spans_with_sound(store.splits[split], what)
        used = [store.recordings[span.recording].skeleton for span in self.spans]
        skeleton = store.skeletons[used[0] if used else 0]
        self.joints: SearchJoints = search_joints(skeleton)
        """The joints, by the names of the first skeleton."""
        self.pose_roles = pose_roles(skeleton)
        """What the J joints of a pose are."""
        fields = (_SEARCH, POSES, PHASES, CEPSTRA)
        self.tracks = Tracks(store, self.spans, fps, fields, title=what)

    def __len__(self) -> int:
        return len(self.tracks)

    def __iter__(self) -> Iterator[Track]:
        for number, span in enumerate(self.spans):
            table = self.tracks.table(number)
            yield Track(
                span,
                float(self.tracks.times_s(np.array([number]), np.array([0]))[0]),
                table["search"].reshape(len(table["search"]), -1),
                table["poses"],
                table["cepstra"][:, :STATIC_CHANNELS],
                table["phases"],
            )

    @property
    def evaluation_roles(self) -> tuple[str, ...]:
        """Which roles are the ten joints of the evaluation, in its order."""
        gesture = self.joints.gesture
        spine = gesture.roles[gesture.evaluation_spine]
        return tuple(spine if name == "spine" else name for name in EVALUATION_JOINTS)
