"""Networks from published checkpoints, without running anything that a checkpoint brings along."""

from __future__ import annotations

import pickle
import pickletools
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast, get_args

import torch
from torch import Tensor, nn

from cospeech.errors import CospeechError, InputFileError
from cospeech.methods.trimodal.networks import (
    POSE_SIZE,
    Context,
    ConvDiscriminator,
    Generator,
    Style,
)

MAX_BYTES = 2 * 2**30
"""Largest checkpoint read; the published ones are about 0.1 GB."""


class Placeholder:
    """Stands for an object of a class we don't know: takes any state, does nothing.

    Published checkpoints hold their command line and vocabularies as pickled objects.
    """

    def __new__(cls, *args: Any, **kwargs: Any) -> Placeholder:
        """Ignore whatever the pickle passes."""
        return super().__new__(cls)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        pass

    def __setstate__(self, state: Any) -> None:
        if isinstance(state, dict):
            self.__dict__.update({str(name): value for name, value in state.items()})


def read_published(path: str | Path) -> dict[str, Any]:
    """The dictionary in a published checkpoint, by torch's restricted loader.

    Every class or function that torch doesn't allow by itself is replaced by `Placeholder`, so
    nothing is imported or called on the checkpoint's behalf.

    Raises:
        InputFileError: Missing, too large, not a checkpoint, or one that names a system module.
    """
    path = Path(path)
    if not path.is_file():
        raise InputFileError(path, "no such checkpoint")
    if path.stat().st_size > MAX_BYTES:
        raise InputFileError(
            path, f"larger than {MAX_BYTES // 2**30} GB, not a published checkpoint"
        )
    try:
        stand_ins: list[Callable[..., Any] | tuple[Callable[..., Any], str]]
        stand_ins = [(Placeholder, name) for name in _foreign_globals(path)]
        with torch.serialization.safe_globals(stand_ins):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, ValueError, EOFError, KeyError, OSError) as error:
        raise InputFileError(
            path, f"not a checkpoint that can be read safely ({str(error).splitlines()[0]:.200})"
        ) from error
    if not isinstance(content, dict):
        raise InputFileError(path, f"holds a {type(content).__name__}, not a dictionary")
    return content


def _foreign_globals(path: Path) -> set[str]:
    """Names a checkpoint refers to beyond what torch's restricted loader allows by itself.

    Listing them executes nothing. What torch allows takes precedence over a stand-in.
    """
    if zipfile.is_zipfile(path):
        return set(torch.serialization.get_unsafe_globals_in_checkpoint(path))
    names: set[str] = set()
    with path.open("rb") as file:
        # Before torch 1.6: magic number, protocol, system facts, then the object, each a pickle.
        for _ in range(4):
            for opcode, argument, _ in pickletools.genops(file):
                if opcode.name == "GLOBAL":
                    names.add(str(argument).replace(" ", "."))
    return names


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
    state, arguments = _select(checkpoint, "gen_dict")
    try:
        words, word_size = state["text_encoder.embedding.weight"].shape
        spare = state["gru.weight_ih_l0"].shape[1] - (POSE_SIZE + 1)
        context = _context(spare, context or arguments.get("input_context"))
        style_size = spare - (64 if context == "both" else 32)
        style: Style = "none" if style_size == 0 else "random"
        speakers = 0
        if "speaker_embedding.0.weight" in state:
            style, speakers = "speaker", len(state["speaker_embedding.0.weight"]) - 1
        network = Generator(
            words,
            speakers,
            word_size=word_size,
            style_size=style_size,
            hidden_size=state["gru.weight_hh_l0"].shape[1],
            layers=_layers(state),
            context=context,
            style=style,
        )
    except KeyError as error:
        raise CospeechError(f"not a trimodal generator: there is no tensor {error}") from None
    _load(network, state)
    return network


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
    state, _ = _select(checkpoint, "dis_dict")
    try:
        network = ConvDiscriminator(
            state["out2.weight"].shape[1] + 6,
            hidden_size=state["gru.weight_hh_l0"].shape[1],
            layers=_layers(state),
        )
    except KeyError as error:
        raise CospeechError(f"not a trimodal discriminator: there is no tensor {error}") from None
    _load(network, state)
    return network


def _select(
    checkpoint: str | Path | Mapping[str, Any], key: str
) -> tuple[Mapping[str, Tensor], dict[str, Any]]:
    """State dict and training arguments (empty when unknown)."""
    if isinstance(checkpoint, str | Path):
        checkpoint = read_published(checkpoint)
    arguments = vars(checkpoint["args"]) if hasattr(checkpoint.get("args"), "__dict__") else {}
    state = checkpoint.get(key, checkpoint)
    if state is None or not all(isinstance(value, Tensor) for value in state.values()):
        raise CospeechError(
            f"the checkpoint holds no state dict under {key!r}; keys: {sorted(checkpoint)[:10]}"
        )
    return state, arguments


def _layers(state: Mapping[str, Tensor]) -> int:
    return sum(re.fullmatch(r"gru\.weight_hh_l\d+", name) is not None for name in state)


def _load(network: nn.Module, state: Mapping[str, Tensor]) -> None:
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise CospeechError(
            f"the tensors don't fit the published network: {error!s:.500}"
        ) from None
    network.eval()
