"""What training and judging share: objects from config, and checks that they belong together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydra.errors import InstantiationException
from hydra.utils import instantiate
from lightning import LightningModule
from omegaconf import DictConfig, MissingMandatoryValue

from cospeech.corpus.store import Store
from cospeech.encoders import encoder_for
from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation import Catalogue
from cospeech.foreign import understood
from cospeech.metrics.encoder import GestureEncoder
from cospeech.nn.weights_file import read_checkpoint


def build(node: Any, **arguments: Any) -> Any:
    """Hydra's `instantiate`, but a `CospeechError` of the constructor comes out as it is.

    Args:
        node: A config with a ``_target_``.
        arguments: Further arguments, given to the constructor as they are. Hydra would make a
            config of a mapping, where ``${`` in a word of a corpus is a reference.

    Raises:
        ConfigError: A key without a default (``data.root``) was not given.
        InstantiationException: Anything else that the constructor raises.
    """
    try:
        if not arguments:
            return instantiate(node, _convert_="all")
        return _called(instantiate(node, _convert_="all", _partial_=True), node, arguments)
    except InstantiationException as error:
        if isinstance(error.__cause__, CospeechError):
            raise error.__cause__ from None
        raise
    except MissingMandatoryValue as error:
        key = str(error.full_key)
        raise ConfigError(f"{key} is not set", f"add {key}=...") from None


def _called(callee: Any, node: Any, arguments: Mapping[str, Any]) -> Any:
    """A call whose exceptions are those of Hydra's own calls."""
    try:
        return callee(**arguments)
    except Exception as error:
        key = node._get_full_key(None) if isinstance(node, DictConfig) else ""
        raise InstantiationException(
            f"Error in call to target {node['_target_']!r}:\n{error!r}\nfull_key: {key}"
        ) from error


def chosen_encoder(store: Store, metrics: DictConfig) -> GestureEncoder:
    """The encoder that the settings ask for."""
    return encoder_for(store, metrics.encoder, metrics.encoder_epochs, metrics.encoder_seed)


def chosen_catalogue(metrics: DictConfig) -> Catalogue:
    """The metrics that the settings name; one that is null is left out."""
    nodes = metrics.get("catalogue") or {}
    return Catalogue({str(name): build(node) for name, node in nodes.items() if node})


def require_same(known: str | None, now: str, what: str) -> None:
    """A resumed or re-evaluated run must meet what it was trained and judged on."""
    if known is not None and known != now:
        raise ConfigError(
            f"{what} has changed since this run was made ({known[:10]} -> {now[:10]}), so its"
            " numbers would not belong together",
            "put the old files back (or the version of Cospeech that made it), or start a new run",
        )


def load_weights(model: LightningModule, path: Path, hint: str) -> None:
    """Put a checkpoint's weights into a module.

    Raises:
        InputFileError: They are damaged, or another module's.
    """
    state = read_checkpoint(path, hint)["state_dict"]
    with understood(path, "a checkpoint of this model", hint):
        model.load_state_dict(state)
