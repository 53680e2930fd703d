"""Networks from published checkpoints, without running anything that a checkpoint brings along."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast, get_args

from torch import Tensor

from cospeech.errors import CospeechError
from cospeech.foreign import understood
from cospeech.methods.trimodal.networks import (
    POSE_SIZE,
    Context,
    ConvDiscriminator,
    Generator,
    Style,
)
from cospeech.nn.weights_file import Network, StandIn, filled, read_weights

MAX_BYTES = 2 * 2**30
"""Largest checkpoint read; the published ones are about 0.1 GB."""


_PUBLISHED = "give a checkpoint that the published code wrote"


def read_published(path: str | Path) -> dict[str, Any]:
    """The dictionary in a published checkpoint, by torch's restricted loader.

    Every class or function that torch doesn't allow by itself is replaced by a `StandIn`, so
    nothing is imported or called on the checkpoint's behalf.

    Raises:
        InputFileError: Missing, too large, not a checkpoint, or one that names a system module.
    """
    return read_weights(
        path,
        _PUBLISHED,
        kind="checkpoint",
        largest_bytes=MAX_BYTES,
        stand_in=True,
    )


def import_published(
    checkpoint: str | Path | Mapping[str, Any], context: Context | None = None
) -> Generator:
    """The generator of a published checkpoint, in eval mode; sizes are read from its tensors.

    Args:
        checkpoint: Path of a checkpoint, its dictionary (key ``gen_dict``), or a bare state dict.
        context: Modalities it was trained with. Needed only for a bare state dict of a
            one-modality model, whose shapes don't tell audio from text.

    Raises:
        InputFileError: The file can't be read safely.
        CospeechError: The tensors are not those of the published generator.
    """
    with understood(_name(checkpoint), "a published trimodal generator", _PUBLISHED):
        return _generator(*_select(checkpoint, "gen_dict"), context)


def _generator(
    state: Mapping[str, Tensor], arguments: dict[str, Any], context: Context | None
) -> Generator:
    try:
        words, word_size = state["text_encoder.embedding.weight"].shape
        spare = state["gru.weight_ih_l0"].shape[1] - (POSE_SIZE + 1)
        context = _context(spare, context or arguments.get("input_context"))
        style_size = spare - (64 if context == "both" else 32)
        style: Style = "none" if style_size == 0 else "random"
        speakers = 0
        if "speaker_embedding.0.weight" in state:
            style, speakers = "speaker", len(state["speaker_embedding.0.weight"]) - 1
        hidden_size = state["gru.weight_hh_l0"].shape[1]
    except KeyError as error:
        raise CospeechError(f"not a trimodal generator: there is no tensor {error}") from None
    return _filled(
        lambda: Generator(
            words,
            speakers,
            word_size=word_size,
            style_size=style_size,
            hidden_size=hidden_size,
            layers=_layers(state),
            context=context,
            style=style,
        ),
        state,
    )


def _context(spare: int, context: str | None) -> Context:
    if context is None and spare >= 64:
        return "both"
    if context is None:
        raise CospeechError(
            "this state dict belongs to a model of one modality",
            "pass context='audio' or context='text'",
        )
    if context not in get_args(Context):
        raise CospeechError(f"the checkpoint was trained with input_context={context!r:.40}")
    return cast(Context, context)


def import_published_discriminator(
    checkpoint: str | Path | Mapping[str, Any],
) -> ConvDiscriminator:
    """The discriminator of a published checkpoint (key ``dis_dict``), as `import_published`."""
    with understood(_name(checkpoint), "a published trimodal discriminator", _PUBLISHED):
        state, _ = _select(checkpoint, "dis_dict")
        try:
            frames = state["out2.weight"].shape[1] + 6
            size = state["gru.weight_hh_l0"].shape[1]
        except KeyError as error:
            problem = f"not a trimodal discriminator: there is no tensor {error}"
            raise CospeechError(problem) from None
        return _filled(
            lambda: ConvDiscriminator(frames, hidden_size=size, layers=_layers(state)), state
        )


def _name(checkpoint: str | Path | Mapping[str, Any]) -> str:
    return "the state dict" if isinstance(checkpoint, Mapping) else str(checkpoint)


def _select(
    checkpoint: str | Path | Mapping[str, Any], key: str
) -> tuple[Mapping[str, Tensor], dict[str, Any]]:
    """State dict and training arguments (empty when unknown)."""
    if isinstance(checkpoint, str | Path):
        checkpoint = read_published(checkpoint)
    arguments = checkpoint.get("args")
    if isinstance(arguments, StandIn):  # of a file
        arguments = arguments.state
    elif hasattr(arguments, "__dict__"):
        arguments = vars(arguments)
    state = checkpoint.get(key, checkpoint)
    if state is None or not all(isinstance(value, Tensor) for value in state.values()):
        raise CospeechError(
            f"the checkpoint holds no state dict under {key!r}; keys: {sorted(checkpoint)[:10]}"
        )
    return state, arguments if isinstance(arguments, dict) else {}


def _layers(state: Mapping[str, Tensor]) -> int:
    return sum(re.fullmatch(r"gru\.weight_hh_l\d+", name) is not None for name in state)


def _filled(make: Callable[[], Network], state: Mapping[str, Tensor]) -> Network:
    try:
        network = filled(make, state)
    except (ValueError, RuntimeError) as error:
        raise CospeechError(
            f"the tensors don't fit the published network: {error!s:.500}"
        ) from None
    return network.eval()
