"""A checkup: everything below a path, recording by recording and then all together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.corpus.reading import usable_cores
from cospeech.corpus.source import Source
from cospeech.corpus.store import Store
from cospeech.doctor.corpus import compare
from cospeech.doctor.examination import Examination
from cospeech.doctor.findings import Check, Finding, Severity
from cospeech.doctor.layouts import find_layout
from cospeech.doctor.listings import check_listings
from cospeech.doctor.reading import Read, StoredPart, read
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.mocap import ReadingSettings, Take
from cospeech.formats.mocap.takes import AS_FILES_SAY
from cospeech.processes import in_order
from cospeech.progress import progress_bar

PART = 32
"""Recordings of a store that are examined in one go."""

WORTH_PROCESSES = 40
"""Items from which other processes are started: each takes seconds to import what it needs."""


@dataclass(frozen=True)
class Checkup:
    """The result.

    Attributes:
        path: What was looked at.
        layout: What it is: ``"store"`` or the name of a layout.
        recordings: Recordings examined.
        seconds: Their length, s.
        findings: Errors first, else in the order of the recordings.
        left_out: Reason -> number of recordings that a rule of the corpus leaves out.
    """

    path: Path
    layout: str
    recordings: int
    seconds: float
    findings: list[Finding]
    left_out: dict[str, int]

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "path": str(self.path),
            "layout": self.layout,
            "recordings": self.recordings,
            "seconds": round(self.seconds, 3),
            "findings": [finding.to_dict() for finding in self.findings],
            "left_out": dict(self.left_out),
        }


def check_path(
    path: str | Path,
    *,
    layout: str | None = None,
    settings: ReadingSettings = AS_FILES_SAY,
    limit: int | None = None,
    by_speakers: bool = False,
    workers: int | None = None,
) -> Checkup:
    """Examine a prepared store or a raw folder.

    Args:
        path: The folder.
        layout: Of a raw folder; found by its files' names when None.
        settings: How motion is read.
        limit: Only so many takes, sources or stored recordings, spread evenly over the corpus; what
            compares recordings sees only those.
        by_speakers: Whether held-out splits are meant to hold other speakers; of a store it is
            known.
        workers: Processes; None: one per core where there is enough to do.

    Raises:
        CospeechError: There is nothing to examine.
    """
    path = Path(path)
    findings: list[Finding] = []
    items: Sequence[Take | Source | StoredPart]
    if (path / "manifest.json").is_file() and layout is None:
        try:
            store = Store(path)
        except InputFileError as error:
            return Checkup(path, "store", 0, 0.0, [_broken(path, error)], {})
        kind, findings = "store", _skipped(store)
        rule = store.manifest["parameters"].get("split", [None])
        by_speakers = by_speakers or rule[0] == "speakers"
        chosen = _evenly(range(len(store.recordings)), limit)
        blocks = [chosen[i : i + PART] for i in range(0, len(chosen), PART)]
        items = [StoredPart(str(path), tuple(block)) for block in blocks]
    else:
        kind, found, findings = _raw(path, layout)
        items = _evenly(found, limit)
    if workers is None or len(items) <= 1:
        workers = usable_cores() if len(items) >= WORTH_PROCESSES else 1
    reads = list(progress_bar(_all_read(items, settings, workers), len(items), f"examining {kind}"))
    examinations: list[Examination] = [e for one in reads for e in one.examinations]
    findings += [finding for one in reads for finding in one.findings]
    findings += compare(examinations, by_speakers)
    order = list(Severity)
    findings.sort(key=lambda finding: order.index(finding.severity))
    left_out: Counter[str] = sum((one.left_out for one in reads), Counter())
    seconds = sum(examination.seconds for examination in examinations)
    return Checkup(path, kind, len(examinations), seconds, findings, dict(left_out))


def _raw(
    path: Path, layout: str | None
) -> tuple[str, Sequence[Take] | Sequence[Source], list[Finding]]:
    found = find_layout(path, layout)
    try:
        items = found.find(path)
    except CospeechError as error:
        # A broken or missing table of one corpus must not hide the recordings from the doctor.
        if found.name not in ("genea", "trinity", "zeggs", "beat"):
            raise
        return "mocap", find_layout(path, "mocap").find(path), [_broken(path, error)]
    takes = [item for item in items if isinstance(item, Take)]
    return found.name, items, list(check_listings(path, takes)) if takes else []


def _evenly(items: Sequence[Any], limit: int | None) -> list[Any]:
    if limit is None or limit >= len(items):
        return list(items)
    return [items[i] for i in np.linspace(0, len(items) - 1, limit).round().astype(int)]


def _all_read(
    items: Sequence[Take | Source | StoredPart], settings: ReadingSettings, workers: int
) -> Iterator[Read]:
    try:
        with closing(in_order(partial(read, settings=settings), items, workers)) as reads:
            yield from reads
    except BrokenProcessPool:
        raise CospeechError(
            "a process was killed, most likely for lack of memory", "start again with --workers 1"
        ) from None


def _broken(path: Path, error: CospeechError) -> Finding:
    return Finding(
        Check.UNREADABLE,
        Severity.ERROR,
        str(error.path if isinstance(error, InputFileError) else path),
        error.problem,
        error.hint or "copy or download it again",
    )


def _skipped(store: Store) -> list[Finding]:
    return [
        Finding(
            Check.UNREADABLE,
            Severity.WARNING,
            f"{store.path} ({dropped['id']})",
            f"was left out when the store was made: {dropped['reason']}",
            "mend the file and prepare the corpus again, or train without it",
        )
        for dropped in store.manifest["skipped"]
        if dropped["is_fault"]
    ]
