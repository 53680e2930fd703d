"""What a run does beside its work, so that its failures cost only itself."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from lightning.pytorch.loggers import Logger

_log = logging.getLogger(__name__)

_WRITING = ("log_metrics", "save", "after_save_checkpoint", "finalize")


@contextmanager
def costs_itself(what: str) -> Iterator[None]:
    """Make a warning of an error inside.

    Args:
        what: What is lost by it, for the warning.
    """
    try:
        yield
    except Exception as error:
        reason = str(error).strip().split("\n", 1)[0] or type(error).__name__
        _log.warning("%s is not written: %s", what, reason[:300])
        _log.debug("why", exc_info=True)


def enduring(logger: Logger) -> Logger:
    """A logger whose first failure (a full disk, a lost server) is said, and ends it alone."""
    state = {"well": True}
    for name in _WRITING:
        setattr(logger, name, _once_failing(getattr(logger, name), type(logger).__name__, state))
    return logger


def _once_failing(
    method: Callable[..., Any], what: str, state: dict[str, bool]
) -> Callable[..., Any]:
    @functools.wraps(method)
    def call(*arguments: Any, **named: Any) -> Any:
        if not state["well"]:
            return None
        with costs_itself(f"the rest of the log of {what}"):
            return method(*arguments, **named)
        state["well"] = False
        return None

    return call


def other_arithmetic(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What differs between two parts of a run of the things that its last bits depend on.

    Args:
        earlier: The record of the part before; an empty one differs in nothing.
        now: The record of this one.
    """
    compared = {
        "torch_threads": ("hardware", "torch_threads"),
        "device": ("hardware", "device"),
        "GPUs": ("hardware", "gpus"),
        "version of torch": ("versions", "torch"),
    }
    differences = []
    for what, (group, name) in compared.items():
        before, after = (_value(record, group, name) for record in (earlier, now))
        if None not in (before, after) and before != after:
            differences.append(f"{what}: {before} before, {after} from here on")
    return differences


def _value(record: Mapping[str, Any], group: str, name: str) -> Any:
    values = record.get(group)
    return values.get(name) if isinstance(values, dict) else None
