"""ELAN annotation files (``.eaf``, formats 2.x and 3.x)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain, pairwise
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cospeech.errors import InputFileError
from cospeech.formats.phase_files.bounded_xml import read_xml
from cospeech.formats.phase_files.tiers import Entry, Tier, read_time

_Times = dict[str, tuple[float, float]]
_ALIGNED, _REFERRING = "ANNOTATION/ALIGNABLE_ANNOTATION", "ANNOTATION/REF_ANNOTATION"


def read_elan(path: Path) -> list[Tier]:
    """One tier per ELAN tier, in the file's order.

    A time slot without a value (a subdivision that nobody aligned) is placed evenly between its
    neighbours in the tier. Annotations that refer to another have its time; several that refer to
    the same one share it evenly.

    Raises:
        InputFileError: The file is no ELAN file, its time unit is another than milliseconds, or two
            annotations have one id.
    """
    document = read_xml(path, "ANNOTATION_DOCUMENT")
    header = document.find("HEADER")
    unit = "milliseconds" if header is None else header.get("TIME_UNITS", "milliseconds")
    if unit != "milliseconds":
        raise InputFileError(path, f"time unit {unit!r}; only milliseconds are read", "HEADER")
    slots: dict[str, float | None] = {}
    for slot in document.iterfind("TIME_ORDER/TIME_SLOT"):
        name, value = slot.get("TIME_SLOT_ID", ""), slot.get("TIME_VALUE")
        slots[name] = None if value is None else read_time(path, value, f"time slot {name}") / 1000
    names = [
        annotation.get("ANNOTATION_ID") for annotation in document.iterfind("TIER/ANNOTATION/*")
    ]
    if len(set(names)) < len(names) or None in names:
        raise InputFileError(path, "annotations without an id of their own")
    tiers = [(tier.get("TIER_ID", ""), tier) for tier in document.iterfind("TIER")]
    order = {name: i for i, name in enumerate(slots)}
    times: _Times = {}
    for _, tier in tiers:
        times |= _aligned(tier.findall(_ALIGNED), slots, order)
    _follow_references(tiers, times)
    return [_tier(name, tier, times) for name, tier in tiers]


def _tier(name: str, element: Element, times: _Times) -> Tier:
    entries = []
    for annotation in chain(element.iterfind(_ALIGNED), element.iterfind(_REFERRING)):
        identity = annotation.get("ANNOTATION_ID", "")
        if identity not in times:
            problem = f"its annotation {identity} has no place in time"
            return Tier(name, problem=problem)
        value = annotation.findtext("ANNOTATION_VALUE") or ""
        entries.append(
            Entry(*times[identity], value.strip(), f"tier {name}, annotation {identity}")
        )
    return Tier(name, entries=entries)


def _aligned(
    annotations: Sequence[Element], slots: dict[str, float | None], order: dict[str, int]
) -> _Times:
    """Times of a tier's annotations; those that can't be known are left out."""
    pairs = [
        (annotation.get("ANNOTATION_ID", ""), first, last)
        for annotation in annotations
        if (first := annotation.get("TIME_SLOT_REF1")) in order
        and (last := annotation.get("TIME_SLOT_REF2")) in order
    ]
    pairs.sort(key=lambda pair: order[pair[1]])
    in_order = list(dict.fromkeys(slot for _, *both in pairs for slot in both))
    time_of = dict(zip(in_order, _filled([slots[slot] for slot in in_order]), strict=True))
    return {
        name: (start, end)
        for name, first, last in pairs
        if (start := time_of[first]) is not None and (end := time_of[last]) is not None
    }


def _filled(times: Sequence[float | None]) -> list[float | None]:
    """Unknown times spread evenly between known ones; those outside stay unknown."""
    filled = list(times)
    known = [(i, time) for i, time in enumerate(times) if time is not None]
    for (before, start), (after, end) in pairwise(known):
        filled[before:after] = np.linspace(start, end, after - before, endpoint=False).tolist()
    return filled


def _follow_references(tiers: Sequence[tuple[str, Element]], times: _Times) -> None:
    """Add the times of annotations that refer to another annotation."""
    children: dict[str, list[list[str]]] = defaultdict(list)
    for _, tier in tiers:
        siblings: dict[str, list[str]] = defaultdict(list)
        for annotation in tier.iterfind(_REFERRING):
            name = annotation.get("ANNOTATION_ID", "")
            siblings[annotation.get("ANNOTATION_REF", "")].append(name)
        for parent, names in siblings.items():
            children[parent].append(names)
    parents = list(times)
    while parents:
        parent = parents.pop()
        start, end = times[parent]
        for names in children.pop(parent, ()):
            share = (end - start) / len(names)
            for i, name in enumerate(names):
                times[name] = (start + share * i, start + share * (i + 1))
            parents += names
