"""What a run tells its callbacks and its caller."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lightning import LightningModule

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.evaluation import Catalogue
from cospeech.metrics.encoder import GestureEncoder
from cospeech.reporting.record import RunRecord


class RunInterrupted(CospeechError):
    """The user stopped the run; everything up to the last finished step is saved."""


@dataclass
class RunContext:
    """What callbacks may know of the run they are part of.

    Attributes:
        folder: The run's folder.
        store: The prepared corpus.
        encoder: Encoder of the evaluation space; None for a model that makes no motion.
        catalogue: The metrics of the evaluation.
        record: The run's `record.json`.
        resume_command: What to type to go on after an interruption.
    """

    folder: Path
    store: Store
    encoder: GestureEncoder | None
    catalogue: Catalogue
    record: RunRecord
    resume_command: str


@dataclass
class RunResult:
    """What a run gives back to Python callers.

    Attributes:
        folder: The run's folder.
        record: Content of its `record.json`.
        objective: The monitored value of the best checkpoint (what a sweep minimises).
        model: The trained model, best checkpoint's weights; None if the run had finished earlier.
    """

    folder: Path
    record: dict[str, Any]
    objective: float | None
    model: LightningModule | None = field(repr=False, default=None)
