"""Weights of the published code, without running anything that a checkpoint brings along.

See docs/facts/trinity_and_gesticulator.md, section 4.7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from cospeech.corpus.facts import CorpusFacts
from cospeech.errors import ContentError, CospeechError
from cospeech.foreign import understood
from cospeech.methods.gesticulator.inputs import Audio
from cospeech.methods.gesticulator.module import Gesticulator
from cospeech.methods.gesticulator.networks import GesticulatorNetwork
from cospeech.nn.weights_file import StandIn, filled, read_weights

PUBLISHED_LAYERS = {
    "first_layer.0": "first_layer.0",
    "hidden_to_output.0": "head.0",
    "hidden_to_output.3": "last",
    "encode_speech.0": "encode_frame.0.0",
    "encode_speech.3": "encode_frame.1.0",
    "reduce_speech_enc.0": "reduce.0",
    "conditioning_1.0": "condition.0",
}
"""Layers of the published network and of ours."""

UNUSED_LAYERS = ("second_layer.0", "third_layer.0")
"""Always in a published checkpoint, and of no effect in its default configuration."""

TEXT_SIZE = 773
"""A vector of BERT and five numbers of timing."""

AUDIO_BY_SIZE: Mapping[int, Audio] = {
    64: "spectrogram",
    26: "mfcc",
    4: "prosody",
    30: "mfcc_prosody",
    68: "spectrogram_prosody",
}

_PUBLISHED = "give a checkpoint that the published code wrote"
_DICTIONARIES = ("pytorch_lightning.utilities.parsing.AttributeDict",)
_FLOATS = ("f4", "f8")


class PublishedNetwork(NamedTuple):
    """What a published checkpoint holds.

    Attributes:
        network: In evaluation mode.
        audio: What it was trained to hear, as `Gesticulator`'s argument.
        mean_pose: ``(pose_size,)`` which motion begins from.
    """

    network: GesticulatorNetwork
    audio: Audio
    mean_pose: Tensor


def our_name(published: str) -> str | None:
    """What a tensor of the published network is called here; None for one that is never used.

    A name that isn't the published network's stays as it is.
    """
    layer, _, part = published.rpartition(".")
    if layer in UNUSED_LAYERS:
        return None
    return f"{PUBLISHED_LAYERS[layer]}.{part}" if layer in PUBLISHED_LAYERS else published


def from_published(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """A published network's tensors under the names of `GesticulatorNetwork`."""
    named = {our_name(name): tensor for name, tensor in tensors.items()}
    return {name: tensor for name, tensor in named.items() if name is not None}


def read_published(path: str | Path, output_times_pi: bool = False) -> PublishedNetwork:
    """The network of a published checkpoint, by torch's restricted loader.

    Checkpoints hold their settings as objects of Lightning and NumPy; none of their classes is
    imported, and nothing is called on the checkpoint's behalf.

    Args:
        path: A Lightning checkpoint of the published code.
        output_times_pi: It was made before 15 October 2020, when what the last layer puts out was
            multiplied by pi. Nothing in a checkpoint tells.

    Raises:
        InputFileError: Missing, too large, not a checkpoint, or its tensors aren't finite ones of
            the published default configuration.
    """
    content = read_weights(
        path, _PUBLISHED, kind="checkpoint", stand_in=True, dictionaries=_DICTIONARIES
    )
    with understood(path, "a published Gesticulator", _PUBLISHED):
        state, settings = content.get("state_dict"), content.get("hyper_parameters")
        if not isinstance(state, dict) or not isinstance(settings, dict):
            raise ContentError("has no state_dict with hyper_parameters", hint=_PUBLISHED)
        if (activation := settings.get("activation", "TanH")) != "TanH":
            raise ContentError(
                f"has the activation {activation!r:.40}, and only networks with TanH are read"
            )
        network = _network(from_published(state))
        mean_pose = _numbers(settings.get("mean_pose"), network.pose_size)
        audio = AUDIO_BY_SIZE.get(network.speech_size - TEXT_SIZE)
        if audio is None:
            raise ContentError(
                f"a frame of its speech is {network.speech_size} numbers, not {TEXT_SIZE} of text"
                f" with {', '.join(map(str, AUDIO_BY_SIZE))} of sound"
            )
    if output_times_pi:
        with torch.no_grad():
            network.last.weight.mul_(math.pi)
            network.last.bias.mul_(math.pi)
    return PublishedNetwork(network, audio, mean_pose)


def import_published(
    path: str | Path,
    corpus: CorpusFacts,
    language_model: str = "bert-base-cased",
    output_times_pi: bool = False,
) -> Gesticulator:
    """A method that speaks with the weights of a published checkpoint.

    Joints that it doesn't make are at rest, where the published code freezes a recorded pose.

    Args:
        path: See `read_published`.
        corpus: Facts of a corpus with the skeleton that the rotations are made for: Trinity's.
        language_model: Folder or hub name of bert-base-cased.
        output_times_pi: See `read_published`.

    Raises:
        InputFileError: See `read_published`; or the language model can't be read.
        CospeechError: Poses are principal components, whose directions no checkpoint holds, or the
            language model's vectors have another size.
    """
    published = read_published(path, output_times_pi)
    method = Gesticulator(corpus, audio=published.audio, language_model=language_model)
    if published.network.pose_size != method.codec.size:
        raise CospeechError(
            f"{path}: its poses are {published.network.pose_size} principal components, and a"
            " checkpoint doesn't hold their directions",
            "give one that was trained without use_pca",
        )
    if method.network.speech_size != published.network.speech_size:
        raise CospeechError(
            f"the vectors of {language_model} are not those of bert-base-cased, which"
            f" {path} was trained with",
            "name its folder",
        )
    method.network.load_state_dict(published.network.state_dict())
    cast(Tensor, method.mean_pose).copy_(published.mean_pose)
    return method.eval()


def _network(state: Mapping[str, Tensor]) -> GesticulatorNetwork:
    speech_size = _size(state, "encode_frame.0.0.weight")
    pose_size = _size(state, "last.weight")
    try:
        return filled(lambda: GesticulatorNetwork(speech_size, pose_size), state).eval()
    except ValueError as error:
        raise ContentError(
            f"has other weights than the published default: {error!s:.200}", hint=_PUBLISHED
        ) from None


def _size(state: Mapping[str, Tensor], name: str) -> int:
    """How many numbers a layer takes."""
    weight = state.get(name)
    if not isinstance(weight, Tensor) or weight.ndim != 2:
        raise ContentError(f"has no weights for {name.removesuffix('.weight')}", hint=_PUBLISHED)
    return weight.shape[1]


def _numbers(value: Any, count: int) -> Tensor:
    """A vector that was pickled as a tensor, a list or an array.

    Raises:
        ContentError: It isn't one of finite numbers, of that length.
    """
    if isinstance(value, StandIn):
        value = _array(value)
    if isinstance(value, list) and all(type(one) in (float, int) for one in value):
        value = torch.tensor(value, dtype=torch.float64)
    if isinstance(value, Tensor) and value.shape == (count,) and value.is_floating_point():
        # A double may be finite where a single is not.
        vector = value.float()
        if vector.isfinite().all():
            return vector
    raise ContentError(f"its mean_pose is no vector of {count} finite numbers", hint=_PUBLISHED)


def _array(pickled: StandIn) -> Tensor | None:
    """What NumPy would make of its pickled array of floats; None of anything else."""
    match pickled.state:
        case (int(), tuple(shape), StandIn(arguments=[str(kind), *_], state=order), _, bytes(raw)):
            pass
        case _:
            return None
    is_known = kind in _FLOATS and isinstance(order, tuple) and order[1:2] in (("<",), (">",))
    if not is_known or len(shape) != 1 or not isinstance(shape[0], int):
        return None
    kind = f"{order[1]}{kind}"
    if len(raw) != shape[0] * np.dtype(kind).itemsize:
        return None
    return torch.from_numpy(np.frombuffer(raw, kind).astype(np.float64))
