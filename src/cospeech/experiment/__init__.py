"""Runs, from a composed config to a record: the only room of the package that knows Hydra.

Names are imported when they are asked for: the commands answer ``--help`` and typing errors
without waiting for the libraries that a run needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cospeech.experiment import folders as folders  # registers the resolver of run folders
from cospeech.terminal import stop_in_order

if TYPE_CHECKING:
    from cospeech.experiment.context import RunContext, RunInterrupted, RunResult
    from cospeech.experiment.evaluating import evaluate
    from cospeech.experiment.folders import run_folder, run_identity
    from cospeech.experiment.generating import generate
    from cospeech.experiment.preparing import prepare
    from cospeech.experiment.training import run

_ROOMS = {
    "RunContext": "context",
    "RunInterrupted": "context",
    "RunResult": "context",
    "evaluate": "evaluating",
    "generate": "generating",
    "prepare": "preparing",
    "run": "training",
    "run_folder": "folders",
    "run_identity": "folders",
}

__all__ = [
    "RunContext",
    "RunInterrupted",
    "RunResult",
    "evaluate",
    "generate",
    "prepare",
    "run",
    "run_folder",
    "run_identity",
]


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    stop_in_order()  # from here on there is something to keep
    return found
