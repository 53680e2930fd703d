"""Weights and inputs of the parity files, rebuilt from their formulas.

The formulas are those of ``data/parity/trimodal/README.md`` beside the checkout; no weight is
stored anywhere. Import as ``from tests.parity_formulas import fill, inputs``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor, nn

BATCH, FRAMES, SAMPLES, WORDS, SPEAKERS = 8, 34, 36_267, 50, 5


def weight(name: str, shape: tuple[int, ...], k: int) -> Tensor:
    """The k-th entry of a network's state dict (``num_batches_tracked`` has no formula)."""
    count = int(np.prod(shape))
    s = np.sin(0.7 * np.arange(count, dtype=np.float64) + k).reshape(shape)
    if name.endswith("running_var"):
        value = 1 + 0.2 * np.abs(s)
    elif name.endswith("running_mean"):
        value = 0.1 * s
    elif name.endswith("weight_g"):
        value = 0.8 + 0.2 * s
    elif len(shape) >= 2:
        value = s * 1.2 / np.sqrt(count / shape[0])
    elif name.endswith("weight"):
        value = 1 + 0.1 * s
    else:
        value = 0.05 * s
    return torch.from_numpy(value.astype(np.float32))


Filled = TypeVar("Filled", nn.Module, dict[str, Tensor])


def fill(target: Filled) -> Filled:
    """Overwrite a module's weights, or a state dict's tensors, in place and return it.

    Entries count from 0 in the target's own order, which must be the published one. Of two names
    for one tensor the later wins, as both are written.
    """
    state = target.state_dict() if isinstance(target, nn.Module) else target
    with torch.no_grad():
        for k, (name, tensor) in enumerate(state.items()):
            if not name.endswith("num_batches_tracked"):
                tensor.copy_(weight(name, tuple(tensor.shape), k))
    return target


def published_shapes(shared: Path, network: str) -> dict[str, tuple[int, ...]]:
    """Tensor names and shapes of a published network, in the published order."""
    path = shared / "data/parity/trimodal/state_dicts.json"
    return {name: tuple(shape) for name, shape in json.loads(path.read_text())[network].items()}


def expected(shared: Path) -> dict[str, np.ndarray]:
    """What the published code returned."""
    with np.load(shared / "data/parity/trimodal/expected.npz", allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def wave(
    shape: tuple[int, ...], f: float, p: float = 0.0, a: float = 1.0, v: int = 0
) -> np.ndarray:
    """``a sin(f n + p + 0.5 v)`` over the elements in C order, float64."""
    n = np.arange(int(np.prod(shape)), dtype=np.float64)
    return (a * np.sin(f * n + p + 0.5 * v)).reshape(shape)


def inputs(v: int = 0) -> dict[str, Tensor]:
    """The batch: poses, audio, words, speakers and the generator's seed_poses."""
    shape = (BATCH, FRAMES, 27)
    poses = wave(shape, 0.013, a=0.4, v=v) + wave(shape, 0.9, p=1, a=0.05, v=v)
    audio_shape = (BATCH, SAMPLES)
    audio = wave(audio_shape, 0.05, a=0.3, v=v) * wave(audio_shape, 0.0007, p=2, v=v)
    words = (7 * np.arange(BATCH * FRAMES) + v).reshape(BATCH, FRAMES) % WORDS
    words[:, 1::3] = 0
    pose_tensor = torch.from_numpy(poses.astype(np.float32))
    seed_poses = torch.zeros(BATCH, FRAMES, 28)
    seed_poses[:, :4, :27] = pose_tensor[:, :4]
    seed_poses[:, :4, 27] = 1
    return {
        "poses": pose_tensor,
        "audio": torch.from_numpy(audio.astype(np.float32)),
        "words": torch.from_numpy(words.astype(np.int64)),
        "speakers": torch.arange(BATCH) % SPEAKERS + 1,
        "seed_poses": seed_poses,
    }
