"""The closed list of what a run may be made of: the methods and corpora that configs offer.

A record names its method and its data module, and a record is a stranger's file. Its names are
looked up here and never imported.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
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


def known_parts(group: str) -> list[KnownPart]:
    """Every yaml of a group that names a class, on the search path of the running command.

    That search path is the project's ``conf`` and what the user adds to it (``--config-dir``).

    Args:
        group: ``"model"`` or ``"data"``.
    """
    base: dict[str, Any] = {}
    found: list[KnownPart] = []
    for source in GlobalHydra.instance().config_loader().get_sources():
        if not source.available() or not source.is_group(group):
            continue
        for name in source.list(group, ObjectType.CONFIG):
            values: Any = OmegaConf.to_container(source.load_config(f"{group}/{name}").config)
            values = values.get(group, values)  # a yaml of the global package says its group
            target = values.pop("_target_", None)
            values.pop("defaults", None)
            if name == BASE:
                base = values
            elif target is not None:
                found.append(KnownPart(name, target, values))
    return [KnownPart(part.name, part.target, base | part.values) for part in found]
