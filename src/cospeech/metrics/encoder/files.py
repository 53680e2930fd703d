"""Reading and writing gesture encoders: our own file, and the published checkpoints."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import parse_json, understood
from cospeech.metrics.encoder.frozen import GestureEncoder
from cospeech.metrics.encoder.network import POSE_SIZE, PoseAutoencoder, flattened_size
from cospeech.motion.upper_body import EVALUATION_FRAMES, TED_AXES
from cospeech.nn.weights_file import filled, read_weights, write_weights

FORMAT = "cospeech.gesture_encoder"
VERSION = 1
LARGEST_FILE_BYTES = 64 * 2**20
"""A published encoder takes about 1 MB; what is far larger is something else."""

_LIGHTNING_NETWORK = "network."
_WHAT = "a gesture encoder"
_OTHER_ENCODER = (
    "use the auto-encoder published for 34-frame windows with Trimodal Context, or"
    " metrics.encoder=trained: one is then trained on the store's training split; or"
    " metrics.encoder=packaged: that of the embedded corpus"
)


def save_encoder(encoder: GestureEncoder, path: str | Path) -> None:
    """Write an encoder as plain tensors and JSON metadata; the file appears only when complete.

    Args:
        encoder: What to save.
        path: File to write; an existing one is replaced.
    """
    metadata = {
        "format": FORMAT,
        "version": VERSION,
        "frames": encoder.frames,
        "sha256": encoder.sha256,
        "source": encoder.source,
    }
    state = {name: tensor.cpu() for name, tensor in encoder.state_dict().items()}
    write_weights(path, {"format": FORMAT, "metadata": json.dumps(metadata), "state": state})


def load_encoder(path: str | Path) -> GestureEncoder:
    """Read an encoder that `save_encoder` wrote.

    Raises:
        InputFileError: Missing, unsafe, of another kind or version, or changed since it was saved.
    """
    path = Path(path)
    content = _read(path)
    with understood(path, _WHAT, _OTHER_ENCODER):
        return _from_own_file(path, content)


def import_published(
    checkpoint: str | Path | Mapping[str, Tensor],
    mean_direction: Sequence[float] | None = None,
    frames: int = EVALUATION_FRAMES,
) -> GestureEncoder:
    """An encoder from a published auto-encoder checkpoint, in TED axes.

    See docs/facts/trimodal.md, section 6.

    Args:
        checkpoint: A checkpoint file, or the network's bare state dict.
        mean_direction: 27 numbers in TED axes; None takes those in the file's training arguments,
            and zeros for a bare state dict.
        frames: Window length that the encoder is wanted for.

    Raises:
        InputFileError: The file is missing, unsafe to read, or not such a checkpoint.
        CospeechError: It was trained on windows of another length or on another skeleton.
    """
    if isinstance(checkpoint, Mapping):
        zeros = [0.0] * POSE_SIZE
        mean = zeros if mean_direction is None else mean_direction
        return _assemble("the state dict", checkpoint, mean, TED_AXES, "state dict", frames)
    path = Path(checkpoint)
    content = _read(path)
    with understood(path, _WHAT, _OTHER_ENCODER):
        return _from_published(path, content, mean_direction, frames)


def load_any(path: str | Path, frames: int = EVALUATION_FRAMES) -> GestureEncoder:
    """Read an encoder from any file that holds one.

    Known are our own encoder files, checkpoints of a ``motion_autoencoder`` run, and published
    checkpoints.

    Args:
        path: The file.
        frames: Window length that the encoder is wanted for.

    Raises:
        InputFileError: The file is missing, unsafe to read, or none of these.
        CospeechError: Trained on windows of another length or on another skeleton.
    """
    path = Path(path)
    content = _read(path)
    with understood(path, _WHAT, _OTHER_ENCODER):
        if content.get("format") == FORMAT:
            encoder = _from_own_file(path, content)
            _require_frames(str(path), encoder.frames, frames)
            return encoder
        if "pytorch-lightning_version" in content:
            return _from_run(path, content, frames)
        return _from_published(path, content, None, frames)


def _read(path: Path) -> dict[str, Any]:
    # Published files carry their training arguments as an argparse.Namespace.
    return read_weights(
        path,
        _OTHER_ENCODER,
        kind="encoder",
        largest_bytes=LARGEST_FILE_BYTES,
        allowed=[argparse.Namespace],
    )


def _from_own_file(path: Path, content: dict[str, Any]) -> GestureEncoder:
    try:
        metadata = parse_json(path, content["metadata"], "an encoder's metadata")
        version, saved_hash, source = (metadata[key] for key in ("version", "sha256", "source"))
        state = dict(content["state"])
        mean, axes = state.pop("mean_direction"), state.pop("axes")
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(
            path, "not an encoder file of ours", hint="metrics.encoder also takes published files"
        ) from error
    if version != VERSION:
        raise InputFileError(
            path, f"encoder format {version}, this version reads {VERSION}", hint="train it anew"
        )
    weights = {name.removeprefix(_LIGHTNING_NETWORK): tensor for name, tensor in state.items()}
    encoder = _assemble(str(path), weights, mean, axes.tolist(), source, metadata["frames"])
    if encoder.sha256 != saved_hash:
        raise InputFileError(
            path, "its weights don't match the hash saved with them", hint="delete it and retrain"
        )
    return encoder


def _from_run(path: Path, content: dict[str, Any], frames: int) -> GestureEncoder:
    state = content.get("state_dict", {})
    weights = {
        name.removeprefix(_LIGHTNING_NETWORK): tensor
        for name, tensor in state.items()
        if name.startswith(_LIGHTNING_NETWORK)
    }
    if "codec.mean_direction" not in state or "decoder.pre_net.0.weight" not in weights:
        raise InputFileError(
            path, "a checkpoint of another method than motion_autoencoder", hint=_OTHER_ENCODER
        )
    mean, axes = state["codec.mean_direction"], state["codec.axes"].tolist()
    return _assemble(str(path), weights, mean, axes, path.name, frames)


def _from_published(
    path: Path, content: dict[str, Any], mean_direction: Sequence[float] | None, frames: int
) -> GestureEncoder:
    if not isinstance(content.get("gen_dict"), Mapping):
        raise InputFileError(
            path, "neither an encoder file nor a published auto-encoder", hint=_OTHER_ENCODER
        )
    # What it was trained on is checked before its mean, which only matching files have.
    weights = content["gen_dict"]
    _require_trained_on(str(path), weights, frames)
    if mean_direction is None:
        mean_direction = _published_mean(path, content.get("args"))
    return _fill(str(path), weights, mean_direction, TED_AXES, path.name)


def _published_mean(path: Path, arguments: object) -> list[float]:
    nested = getattr(arguments, "mean_dir_vec", None)
    try:
        mean = torch.tensor(nested, dtype=torch.float32).flatten()
    except (TypeError, ValueError, RuntimeError):
        mean = torch.empty(0)
    if mean.shape != (POSE_SIZE,) or not mean.isfinite().all():
        raise InputFileError(
            path,
            f"its training arguments hold no mean direction vector of {POSE_SIZE} numbers",
            place="args.mean_dir_vec",
            hint="pass mean_direction to import_published",
        )
    return mean.tolist()


def _assemble(
    name: str,
    weights: Mapping[str, Tensor],
    mean_direction: Sequence[float] | Tensor,
    axes: Sequence[float],
    source: str,
    frames: int,
) -> GestureEncoder:
    _require_trained_on(name, weights, frames)
    return _fill(name, weights, mean_direction, axes, source)


def _require_trained_on(name: str, weights: Mapping[str, Tensor], frames: int) -> None:
    """Refuse weights for another skeleton, or for windows of another length than ``frames``."""
    try:
        width = weights["pose_encoder.net.0.0.weight"].shape[1]
        if width != POSE_SIZE:
            raise CospeechError(
                f"{name}: reads {width} numbers a frame, where the nine direction vectors of the"
                f" evaluation space are {POSE_SIZE}: it was trained on another skeleton",
                _OTHER_ENCODER,
            )
        trained = PoseAutoencoder.frames_of(weights)
    except (KeyError, IndexError, AttributeError) as error:
        raise CospeechError(
            f"{name}: not the published motion auto-encoder, {error} is missing", _OTHER_ENCODER
        ) from error
    _require_frames(name, trained, frames)


def _fill(
    name: str,
    weights: Mapping[str, Tensor],
    mean_direction: Sequence[float] | Tensor,
    axes: Sequence[float],
    source: str,
) -> GestureEncoder:
    try:
        network = filled(lambda: PoseAutoencoder.sized_like(weights), weights)
    except (KeyError, ValueError, RuntimeError) as error:
        raise CospeechError(
            f"{name}: not the published motion auto-encoder: {error}", _OTHER_ENCODER
        ) from error
    return GestureEncoder(network, mean_direction, axes, source)


def _require_frames(name: str, trained: int, wanted: int) -> None:
    if trained != wanted:
        raise CospeechError(
            f"{name}: trained on windows of {trained} frames. Its first dense layer expects"
            f" {flattened_size(trained)} numbers, and the windows here, of {wanted} frames, give"
            f" {flattened_size(wanted)}",
            _OTHER_ENCODER,
        )
