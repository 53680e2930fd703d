"""Runs, from a composed config to a record: the only room of the package that knows Hydra."""

from cospeech.experiment.command_line import command_line
from cospeech.experiment.context import RunContext, RunInterrupted, RunResult
from cospeech.experiment.folders import run_folder, run_identity
from cospeech.experiment.generating import generate
from cospeech.experiment.judging import evaluate, prepare
from cospeech.experiment.training import run

__all__ = [
    "RunContext",
    "RunInterrupted",
    "RunResult",
    "command_line",
    "evaluate",
    "generate",
    "prepare",
    "run",
    "run_folder",
    "run_identity",
]
