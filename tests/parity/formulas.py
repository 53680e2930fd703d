"""Weights and inputs of the parity sets, rebuilt from their formulas, and the numbers expected.

A set is a folder with ``expected.npz``, what published code returned for these weights and inputs;
README.md beside this file says whose. No weight is stored. ``COSPEECH_PARITY_DIR`` names another
folder of sets of the same shape and ``COSPEECH_PARITY_V`` the ``v`` that it was made with.
"""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn

SHIPPED = Path(__file__).parent
FOLDER = Path(os.environ.get("COSPEECH_PARITY_DIR") or SHIPPED)
V = int(os.environ.get("COSPEECH_PARITY_V") or 0)

BATCH, FRAMES, SAMPLES, WORDS, SPEAKERS = 8, 34, 36_267, 50, 5


@cache
def expected(name: str) -> dict[str, np.ndarray]:
    """What the published code returned, by entry; skips where another folder lacks the set."""
    path = FOLDER / name / "expected.npz"
    if FOLDER != SHIPPED and not path.is_file():
        pytest.skip(f"COSPEECH_PARITY_DIR has no {path}")
    with np.load(path, allow_pickle=False) as arrays:
        return {entry: arrays[entry] for entry in arrays.files}


def published_shapes(name: str, network: str) -> dict[str, tuple[int, ...]]:
    """Tensor names and shapes of a published network, in the published order."""
    shapes = json.loads((FOLDER / name / "state_dicts.json").read_text())[network]
    return {tensor: tuple(shape) for tensor, shape in shapes.items()}


# --- trimodal and trimodal_mixed ------------------------------------------------------------------


def weight(name: str, shape: tuple[int, ...], k: int, v: int = V) -> Tensor:
    """The k-th entry of a network's state dict (``num_batches_tracked`` has no formula)."""
    count = int(np.prod(shape))
    r = np.random.RandomState(7000 + 1000 * v + k).standard_normal(count).reshape(shape)
    if name.endswith("running_var"):
        value = 1 + 0.2 * np.abs(r)
    elif name.endswith("running_mean"):
        value = 0.1 * r
    elif name.endswith("weight_g"):
        value = 0.8 + 0.1 * r
    elif name.endswith("embedding.weight"):
        value = 0.5 * r
    elif len(shape) >= 2:
        value = 1.2 * r / np.sqrt(count / shape[0])
    elif name.endswith("weight"):
        value = 1 + 0.1 * r
    else:
        value = 0.05 * r
    return torch.from_numpy(value.astype(np.float32))


Filled = TypeVar("Filled", nn.Module, dict[str, Tensor])


def fill(target: Filled, v: int = V) -> Filled:
    """Overwrite a module's weights, or a state dict's tensors, in place and return it.

    Entries count from 0 in the target's own order, which must be the published one. Of two names
    for one tensor the later wins, as both are written.
    """
    state = target.state_dict() if isinstance(target, nn.Module) else target
    with torch.no_grad():
        for k, (name, tensor) in enumerate(state.items()):
            if not name.endswith("num_batches_tracked"):
                tensor.copy_(weight(name, tuple(tensor.shape), k, v))
    return target


def wave(
    shape: tuple[int, ...], f: float, p: float = 0.0, a: float = 1.0, v: int = V
) -> np.ndarray:
    """``a sin(f n + p + 0.5 v)`` over the elements in C order, float64."""
    n = np.arange(int(np.prod(shape)), dtype=np.float64)
    return (a * np.sin(f * n + p + 0.5 * v)).reshape(shape)


def inputs(v: int = V) -> dict[str, Tensor]:
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


def frechet_samples(v: int = V) -> tuple[np.ndarray, np.ndarray]:
    """``(3000, 32)`` and ``(2000, 32)``, the second wider and off its centre."""
    random = np.random.RandomState(100 + v)
    return random.standard_normal((3000, 32)), random.standard_normal((2000, 32)) * 1.2 + 0.05


# --- gesticulator ---------------------------------------------------------------------------------


def waveform_16_bit(rate: int, v: int = V) -> np.ndarray:
    """Three seconds of int16: a sweep, a beating tone, noise, and a pause from 1.4 to 1.7 s."""
    n = np.arange(3 * rate, dtype=np.int64)
    t = n / rate
    sweep = 0.35 * np.sin(2 * np.pi * (140 * t + 25 * t**2) + 0.5 * v)
    tone = 0.15 * np.sin(2 * np.pi * 1200 * t + 1 + 0.5 * v) * np.sin(2 * np.pi * 1.5 * t) ** 2
    noise = 0.02 * np.sin((n * n + 7 * n + 101 * 5) % 65_521 + 0.5 * v)
    x = (sweep + tone + noise) * (0.55 + 0.45 * np.sin(2 * np.pi * 2 * t + 0.5 * v))
    x[(t >= 1.4) & (t < 1.7)] = 0
    return np.rint(32_767 * x).astype(np.int16)


def quadratic(n: np.ndarray, c: int) -> np.ndarray:
    """Angles that don't repeat: ``(n n + 7 n + 101 c) mod 65521``."""
    n = np.asarray(n, dtype=np.int64)
    return (n * n + 7 * n + 101 * c) % 65_521


def noise(shape: tuple[int, ...], c: int, a: float, v: int = V) -> np.ndarray:
    """``a sin(quadratic(n, c) + 0.5 v)`` over the elements in C order, float64."""
    n = np.arange(int(np.prod(shape)))
    return (a * np.sin(quadratic(n, c) + 0.5 * v)).reshape(shape)


def gesticulator_weights(network: str) -> dict[str, Tensor]:
    """A published network's weights, by its names."""
    weights = {}
    for k, (name, shape) in enumerate(published_shapes("gesticulator", network).items()):
        values = np.sin(quadratic(np.arange(int(np.prod(shape))), k).astype(float)).reshape(shape)
        scale = 1.2 / np.sqrt(shape[1]) if len(shape) == 2 else 0.05
        weights[name] = torch.from_numpy((scale * values).astype(np.float32))
    return weights


def gesticulator_inputs(pose_size: int, v: int = V) -> tuple[Tensor, Tensor, Tensor]:
    """Speech ``(4, 70, 837)``, poses ``(4, 70, pose_size)`` and the mean pose."""
    clip, frame = np.arange(4)[:, None, None], np.arange(70)[None, :, None]
    audio = -8 + 3 * np.sin(0.23 * frame + 0.05 * np.arange(64) + clip + 0.5 * v)
    audio = audio + noise((4, 70, 64), 1, 1, v)
    u = np.arange(35)
    text = np.zeros((4, 35, 773))
    text[..., :768] = noise((4, 35, 768), 2, 0.5, v)
    of_word = [1 + u % 3, 3 - u % 3, 3 + 0 * u, (1 + u % 3) / 3, (1 + (u // 3) % 3) / 3]
    text[..., 768:] = np.stack(of_word, axis=-1)
    text[:, u % 7 == 0] = [-15.0] * 768 + [0.0] * 5
    channel = np.arange(pose_size)
    poses = 0.3 * np.sin(0.11 * frame + 1.7 * channel + 0.9 * clip + 0.5 * v)
    poses = poses + noise((4, 70, pose_size), 3, 0.02, v)
    mean = 0.1 * np.sin(0.9 * channel + 0.5 * v)
    speech = np.concatenate([audio, text.repeat(2, axis=1)], axis=-1)
    return tuple(torch.from_numpy(values.astype(np.float32)) for values in (speech, poses, mean))
