"""What trained systems make for held-out speech."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.windows import WindowDataset
from cospeech.errors import CospeechError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import MakesJoints
from cospeech.motion.gesture_joints import GestureJoints
from cospeech.progress import progress_bar
from cospeech.speech.speech import Speech
from cospeech.studies.multi_adversary_figures.held_out import HeldOut
from cospeech.studies.multi_adversary_figures.measured import FPS, SystemMotion
from cospeech.studies.multi_adversary_figures.paper import PAPER_SYSTEMS
from cospeech.studies.trained_system import TrainedSystem

_BATCH = 64


def in_paper_order(systems: Sequence[TrainedSystem]) -> list[TrainedSystem]:
    """Systems in the order of the paper's figure 11, then by name; seeds of one together."""
    order = {name: place for place, name in enumerate(PAPER_SYSTEMS)}
    return sorted(systems, key=lambda s: (order.get(s.name, len(order)), s.name, s.seed))


def label_joints(
    classifier: FrozenPhaseClassifier,
    joints: NDArray[np.float32],
    layout: GestureJoints,
    pitch: NDArray[np.float32],
) -> NDArray[np.int64]:
    """Likeliest phase of each step of a recording at 20 fps.

    Args:
        classifier: The classifier.
        joints: ``(T, J, 3)`` in the order of ``layout.roles``, T >= 2, body frame, metres.
        layout: Which joints they are.
        pitch: ``(T,)`` F0, Hz.

    Returns:
        ``(T,)`` class indices; the first frame, which no step leads to, has the second's.
    """
    chosen = classifier.choose(torch.from_numpy(joints), layout).numpy()
    labels = classifier.step_probabilities(chosen, pitch).argmax(axis=-1)
    return np.concatenate([labels[:1], labels])


def motion_of(
    system: TrainedSystem, held_out: HeldOut, chosen: NDArray[np.int64], roles: Sequence[str]
) -> SystemMotion:
    """What a system makes for the held-out speech, its joints in the order of the roles."""
    method = system.method
    assert isinstance(method, MakesJoints)
    training = method.training
    method.eval()
    takes = held_out.takes
    title = f"{system.name}, seed {system.seed}"
    recordings = [
        _generated(system, held_out.store.speech(take.span), len(take.joints), roles)
        for take in progress_bar(takes, len(takes), title)
    ]
    windows = _sampled(method, held_out.windows, chosen)
    rows = [held_out.side_by_side(take) for take in takes]
    consecutive = _sampled(method, held_out.windows, np.concatenate(rows))
    edges = np.cumsum([len(part) for part in rows])[:-1]
    side_by_side = [part.reshape(-1, *part.shape[2:]) for part in np.split(consecutive, edges)]
    method.train(training)
    return SystemMotion(
        name=system.name,
        windows=windows,
        recordings=recordings,
        side_by_side=side_by_side,
        border_frames=method.border_frames(),
        seed=system.seed,
    )


@torch.no_grad()
def _sampled(
    method: MakesJoints, windows: WindowDataset, chosen: NDArray[np.int64]
) -> NDArray[np.float32]:
    assert isinstance(method, GestureMethod)
    parts = [
        method.sample_joints(windows.batch(chosen[first : first + _BATCH]).to(method.device)).cpu()
        for first in range(0, len(chosen), _BATCH)
    ]
    return torch.cat(parts).numpy()


def _generated(
    system: TrainedSystem, speech: Speech, frames: int, roles: Sequence[str]
) -> NDArray[np.float32]:
    """Motion for a recording, ``(frames, J, 3)`` in the order of the roles."""
    assert isinstance(system.method, MakesJoints)
    motion = system.method.generate_joints(speech)
    names = list(motion.skeleton.joints)
    if motion.fps != FPS or set(roles) - set(names):
        raise CospeechError(
            f"{system.name}: motion of {', '.join(names)} at {motion.fps:g} fps, where the corpus"
            f" has {', '.join(roles)} at {FPS:g} fps",
            "judge a run on the corpus that it was trained on",
        )
    if len(motion) < frames - 1:
        raise CospeechError(
            f"{system.name}: {len(motion)} frames of motion for speech of {frames} frames"
        )
    joints = motion.positions[:frames, [names.index(role) for role in roles]]
    # a recording can end with motion that its audio no longer covers
    return np.concatenate([joints, joints[-1:].repeat(frames - len(joints), axis=0)])
