"""Writing gesture phases: a table, and an ELAN document to look at and correct."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from cospeech.files import replacing
from cospeech.motion.phases import PHASES, PhaseSegment

_EAF_NAMESPACE = "http://www.w3.org/2001/XMLSchema-instance"
_EAF_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
_MEDIA_TYPES = {".wav": "audio/x-wav", ".mp4": "video/mp4"}


def phase_segments(labels: NDArray[np.integer], fps: float) -> list[PhaseSegment]:
    """Frames' labels as segments; `cospeech.motion.phases.frame_phases` gives the labels back.

    Times are whole milliseconds, as ELAN keeps them, rounded down: a frame is never late.

    Args:
        labels: ``(T,)`` indices into `PHASES`.
        fps: Frames per second, below 1000.
    """
    edges = np.flatnonzero(np.diff(labels, prepend=-1, append=-1))
    times = np.floor(edges / fps * 1000 + 1e-6) / 1000
    return [
        PhaseSegment(float(start_s), float(end_s), PHASES[labels[edge]])
        for edge, (start_s, end_s) in zip(edges, pairwise(times.tolist()), strict=False)
    ]


def write_phase_table(
    path: str | Path, segments: Sequence[PhaseSegment], names: Sequence[str] | None = None
) -> None:
    """A table that `read_phases` reads: ``start_s``, ``end_s``, ``phase``, perhaps ``class``.

    Args:
        path: A ``.csv`` file; an existing one is replaced when the new one is complete.
        segments: In order.
        names: What to write as the class of each segment.
    """
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as f,
    ):
        rows = csv.writer(f, lineterminator="\n")
        rows.writerow(["start_s", "end_s", "phase", *(["class"] if names else [])])
        for i, segment in enumerate(segments):
            times = f"{segment.start_s:.3f}", f"{segment.end_s:.3f}"
            rows.writerow([*times, segment.label, *([names[i]] if names else [])])


def write_elan(
    path: str | Path,
    segments: Iterable[PhaseSegment],
    media: Sequence[str | Path] = (),
) -> None:
    """An ELAN document (EAF 3.0) with one tier of phases, which `read_phases` reads.

    Args:
        path: An ``.eaf`` file; an existing one is replaced when the new one is complete.
        segments: In order, not overlapping.
        media: Sound or video files to link; ELAN asks for those that it can't find.
    """
    schema = {
        "xmlns:xsi": _EAF_NAMESPACE,
        "xsi:noNamespaceSchemaLocation": _EAF_SCHEMA,
        "AUTHOR": "cospeech",
        "DATE": "1970-01-01T00:00:00+00:00",
        "FORMAT": "3.0",
        "VERSION": "3.0",
    }
    document = ET.Element("ANNOTATION_DOCUMENT", schema)
    header = ET.SubElement(document, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    for file in map(Path, media):
        ET.SubElement(
            header,
            "MEDIA_DESCRIPTOR",
            MEDIA_URL=file.absolute().as_uri(),
            MIME_TYPE=_MEDIA_TYPES.get(file.suffix.lower(), "unknown"),
            RELATIVE_MEDIA_URL=f"./{file.name}",
        )
    slots = ET.SubElement(document, "TIME_ORDER")
    annotations = ET.SubElement(
        document, "TIER", TIER_ID="gesture phases", LINGUISTIC_TYPE_REF="phase", PARTICIPANT=""
    )
    for i, segment in enumerate(segments):
        ends = []
        for k, time_s in enumerate((segment.start_s, segment.end_s)):
            ends.append(f"ts{2 * i + k + 1}")
            milliseconds = str(round(time_s * 1000))
            ET.SubElement(slots, "TIME_SLOT", TIME_SLOT_ID=ends[-1], TIME_VALUE=milliseconds)
        element = ET.SubElement(
            ET.SubElement(annotations, "ANNOTATION"),
            "ALIGNABLE_ANNOTATION",
            ANNOTATION_ID=f"a{i + 1}",
            TIME_SLOT_REF1=ends[0],
            TIME_SLOT_REF2=ends[1],
        )
        ET.SubElement(element, "ANNOTATION_VALUE").text = segment.label
    ET.SubElement(
        document,
        "LINGUISTIC_TYPE",
        LINGUISTIC_TYPE_ID="phase",
        TIME_ALIGNABLE="true",
        GRAPHIC_REFERENCES="false",
    )
    ET.indent(document)
    with replacing(path) as temporary:
        ET.ElementTree(document).write(temporary, encoding="utf-8", xml_declaration=True)
