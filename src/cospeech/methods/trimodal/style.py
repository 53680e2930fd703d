"""What a caller may ask of the style space: a speaker, a mix of speakers, or a point in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from cospeech.errors import CospeechError
from cospeech.methods.trimodal.networks import Generator, Posterior

CONTROLS = ("style", "speaker_mix")


@dataclass(frozen=True, eq=False)
class StyleRequest:
    """A wish for a style, checked against the model.

    Attributes:
        vector: ``(style_size,)`` point in the style space, taken as it is.
        weights: Speaker id -> share; shares sum to 1. Empty when nobody was asked for.
    """

    vector: Tensor | None
    weights: dict[int, float]

    def posterior(self, generator: Generator) -> Posterior:
        """The speakers' mean and log variance, interpolated by their shares, each ``(1, size)``.

        A mix with all weight on one speaker is that speaker.
        """
        device = generator.speaker_mu.weight.device
        mu, logvar = generator.style_posterior(torch.tensor(list(self.weights), device=device))
        shares = torch.tensor(list(self.weights.values()), device=device).unsqueeze(1)
        return Posterior(
            (shares * mu).sum(dim=0, keepdim=True), (shares * logvar).sum(dim=0, keepdim=True)
        )


def read_style_request(
    speaker: str | None,
    controls: Mapping[str, Any],
    speakers: Sequence[str],
    generator: Generator,
) -> StyleRequest:
    """Check and resolve what the caller asked for.

    Args:
        speaker: A training speaker's name.
        controls: ``{"style": [style_size numbers]}`` or ``{"speaker_mix": {name: weight, ...}}``,
            whose weights are divided by their sum.
        speakers: Training speakers; speaker i has id i + 1.
        generator: The network, for its kind and size of style.

    Raises:
        CospeechError: An unknown speaker, more than one wish, a wish the model has no
            input for, or a malformed value.
    """
    wishes = [*sorted(controls), *(["speaker"] if speaker is not None else [])]
    if len(wishes) > 1:
        raise CospeechError(f"{' and '.join(wishes)} exclude each other", "give one of them")
    if speaker is not None:
        weights = {_speaker_id(speaker, speakers): 1.0}
        return StyleRequest(None, weights if generator.style == "speaker" else {})
    if "style" in controls:
        if generator.style == "none":
            raise CospeechError("this model was trained without a style input (style=none)")
        return StyleRequest(_style_vector(controls["style"], generator.style_size), {})
    if "speaker_mix" in controls:
        if generator.style != "speaker":
            raise CospeechError(f"this model knows no speakers (style={generator.style})")
        return StyleRequest(None, _speaker_mix(controls["speaker_mix"], speakers))
    return StyleRequest(None, {})


def known_controls(values: Any) -> dict[str, Any]:
    """Controls by their names.

    Raises:
        CospeechError: Not a mapping, or an unknown name.
    """
    known = f"the trimodal method knows {', '.join(CONTROLS)}"
    if not isinstance(values, Mapping):
        raise CospeechError(f"controls are a mapping, not {values!r:.80}; {known}")
    if unknown := [name for name in values if name not in CONTROLS]:
        raise CospeechError(f"no control {min(map(str, unknown))!r}; {known}")
    return dict(values)


def _speaker_id(name: str, speakers: Sequence[str]) -> int:
    try:
        return speakers.index(name) + 1
    except ValueError:
        shown = ", ".join(speakers[:20]) + (" ..." if len(speakers) > 20 else "")
        raise CospeechError(
            f"no training speaker {name!r} among {len(speakers)}", f"choose one of: {shown}"
        ) from None


def _style_vector(value: Any, size: int) -> Tensor:
    try:
        style = torch.as_tensor(value, dtype=torch.float32)
    except (TypeError, ValueError, RuntimeError) as error:
        raise CospeechError(f"control 'style' is not a list of numbers: {error}") from error
    if style.shape != (size,) or not style.isfinite().all():
        raise CospeechError(f"control 'style' needs {size} finite numbers, got {value!r:.80}")
    return style


def _speaker_mix(value: Any, speakers: Sequence[str]) -> dict[int, float]:
    try:
        weights = {_speaker_id(name, speakers): float(weight) for name, weight in value.items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise CospeechError(
            f"control 'speaker_mix' maps speaker names to numbers, got {value!r:.80}"
        ) from error
    total = sum(weights.values())
    if not (math.isfinite(total) and total > 0):
        raise CospeechError(f"the weights of 'speaker_mix' sum to {total:g}, not above 0")
    return {speaker: weight / total for speaker, weight in weights.items()}
