"""ELAN annotation files (``.eaf``, formats 2.x and 3.x)."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Sequence
from itertools import chain, pairwise
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cospeech.errors import ContentError
from cospeech.formats.phase_files.bounded_xml import read_xml
from cospeech.formats.phase_files.tiers import Entry, Tier, read_time

_log = logging.getLogger(__name__)

_Times = dict[str, tuple[float, float]]
_ALIGNED, _REFERRING = "ANNOTATION/ALIGNABLE_ANNOTATION", "ANNOTATION/REF_ANNOTATION"


def read_elan(path: Path) -> list[Tier]:
    """One tier per ELAN tier, in the file's order.

    Times are those of the media file: where the annotator moved its start (``TIME_ORIGIN``), that
    is added. Of several media files the one that is called like the annotation counts.

    A time slot without a value (a subdivision that nobody aligned) is placed evenly between its
    neighbours in the tier. Annotations that refer to another have its time; several that refer to
    the same one share it evenly.

    Raises:
        ContentError: The file is no ELAN file, its time unit is another than milliseconds, two
            annotations have one id, or it can't be told which of several media files has their
            clock.
    """
    document = read_xml(path, "ANNOTATION_DOCUMENT")
    header = document.find("HEADER")
    unit = "milliseconds" if header is None else header.get("TIME_UNITS", "milliseconds")
    if unit != "milliseconds":
        raise ContentError(f"time unit {unit!r}; only milliseconds are read", "HEADER")
    origin_s = _time_origin(path, header)
    slots: dict[str, float | None] = {}
    for slot in document.iterfind("TIME_ORDER/TIME_SLOT"):
        name, value = slot.get("TIME_SLOT_ID", ""), slot.get("TIME_VALUE")
        time_s = None if value is None else read_time(value, f"time slot {name}") / 1000
        slots[name] = None if time_s is None else time_s + origin_s
    names = [
        annotation.get("ANNOTATION_ID") for annotation in document.iterfind("TIER/ANNOTATION/*")
    ]
    if len(set(names)) < len(names) or None in names:
        raise ContentError("annotations without an id of their own")
    tiers = [(tier.get("TIER_ID", ""), tier) for tier in document.iterfind("TIER")]
    order = {name: i for i, name in enumerate(slots)}
    times: _Times = {}
    for _, tier in tiers:
        times |= _aligned(tier.findall(_ALIGNED), slots, order)
    _follow_references(tiers, times)
    return [_tier(name, tier, times) for name, tier in tiers]


def _time_origin(path: Path, header: Element | None) -> float:
    """Second of the media file at which the annotation's clock starts."""
    origins: dict[str, set[float]] = {}
    for descriptor in [] if header is None else header.findall("MEDIA_DESCRIPTOR"):
        url = descriptor.get("RELATIVE_MEDIA_URL") or descriptor.get("MEDIA_URL") or ""
        stem = url.replace("\\", "/").rpartition("/")[2].rpartition(".")[0].lower()
        origin = read_time(descriptor.get("TIME_ORIGIN", "0"), "TIME_ORIGIN") / 1000
        origins.setdefault(stem, set()).add(origin)
    known = origins.get(path.stem.lower()) or set().union(*origins.values()) or {0.0}
    if len(known) > 1:
        starts = ", ".join(f"{origin:g} s" for origin in sorted(known))
        raise ContentError(
            f"its media files start at {starts} (TIME_ORIGIN), and none of them alone is called"
            f" {path.stem}",
            "HEADER",
            "in ELAN, keep the one that has the motion's clock among the linked files",
        )
    (origin_s,) = known
    if origin_s:
        _log.info("%s: annotations start at %g s of the media file", path, origin_s)
    return origin_s


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
