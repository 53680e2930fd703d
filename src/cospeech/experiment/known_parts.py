"""The closed list of what a run may be made of: the methods and corpora that configs offer.

A record names its method and its data module, and a record is a stranger's file. Its names are
looked up here and never imported.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigSource
from omegaconf import OmegaConf

BASE = "base"
"""The yaml of a group that its others begin with."""


@dataclass(frozen=True)
class KnownPart:
    """One yaml of a group.

    Attributes:
        name: How it is chosen: ``model=NAME``, ``data=NAME``.
        target: Import path of its class.
        values: Its keys and what they are by default, interpolations as they are written.
    """

    name: str
    target: str
    values: dict[str, Any]


def names_of(group: str) -> list[str]:
    """What a group offers.

    That is what lies on the search path of the running command, the project's ``conf`` and what the
    user adds to it (``--config-dir``); in Python, where no command runs, ``conf`` alone.

    Args:
        group: ``"model"``, ``"data"`` or ``"metrics"``.
    """
    return sorted({name for _, name in _offered(group)} - {BASE})


def known_part(group: str, name: str) -> KnownPart | None:
    """A yaml of a group; None where the group has none of this name, or it is of no class."""
    values: dict[str, Any] = {}
    for source, offered in sorted(_offered(group), key=lambda pair: pair[1] != BASE):
        if offered in (BASE, name):
            config: Any = OmegaConf.to_container(source.load_config(f"{group}/{offered}").config)
            values |= config.get(group, config)  # a yaml of the global package says its group
    target = values.pop("_target_", None)
    values.pop("defaults", None)
    return None if target is None else KnownPart(name, target, values)


def _offered(group: str) -> list[tuple[ConfigSource, str]]:
    hydra = GlobalHydra.instance()
    sources = hydra.config_loader().get_sources() if hydra.is_initialized() else [_own_conf()]
    return [
        (source, name)
        for source in sources
        if source.available() and source.is_group(group)
        for name in source.list(group, ObjectType.CONFIG)
    ]


def _own_conf() -> ConfigSource:
    """The project's ``conf``: beside ``src`` in a checkout, inside the package where installed."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "conf"
    return FileConfigSource(
        "main", f"file://{folder if folder.is_dir() else package.parents[1] / 'conf'}"
    )
