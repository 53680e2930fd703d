"""The encoder that ships with the package: trained once, on the embedded corpus."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import read_json, understood
from cospeech.metrics.encoder.files import load_encoder
from cospeech.metrics.encoder.frozen import GestureEncoder

WEIGHTS = Path(str(files("cospeech.metrics.encoder"))) / "packaged.pt"
RECIPE = WEIGHTS.with_suffix(".json")
"""What made the weights: commands, settings, corpus, versions, and the encoder's hash."""

_INSTALL_AGAIN = (
    "the file comes with Cospeech: install it again, or put it back with git checkout;"
    " metrics.encoder=trained does without it"
)


def packaged_encoder() -> GestureEncoder:
    """The encoder of the embedded corpus, the same on every machine.

    Each machine's arithmetic would train another one, and distances taken with two encoders can't
    be compared (docs/judging.md).

    Raises:
        CospeechError: The installed file is missing or damaged, or isn't the encoder that its
            recipe is of.
    """
    try:
        encoder = load_encoder(WEIGHTS)
        recipe = read_json(RECIPE, "an encoder's recipe")
        with understood(RECIPE, "an encoder's recipe"):
            recorded = str(recipe["sha256"])
    except CospeechError as error:
        raise CospeechError(error.problem, _INSTALL_AGAIN) from error
    if encoder.sha256 != recorded:
        raise InputFileError(
            WEIGHTS,
            f"is the encoder {encoder.sha256[:12]}, and {RECIPE.name} beside it is of"
            f" {recorded[:12]}",
            hint=_INSTALL_AGAIN,
        )
    return encoder
