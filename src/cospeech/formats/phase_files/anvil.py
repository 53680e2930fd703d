"""ANVIL annotation files (``.anvil``).

``annotation/body/track/el/attribute``: elements of a primary track have ``start`` and ``end`` in
seconds; those of a span track name the first and last element of the track that it refers to, those
of a singleton track name one.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from cospeech.errors import ContentError
from cospeech.formats.phase_files.bounded_xml import read_xml
from cospeech.formats.phase_files.tiers import Entry, Tier, read_time

MAX_REFERENCES = 16
"""Tracks that refer to a track that refers to a track ...; real files have two or three."""

_Times = tuple[list[tuple[float, float]], str]


def read_anvil(path: Path) -> list[Tier]:
    """One tier per track and attribute, in the file's order.

    Raises:
        ContentError: The file is no ANVIL file, a time is no number, or an element refers to one
            that isn't there.
    """
    tracks = {
        track.get("name", ""): track
        for track in read_xml(path, "annotation").iterfind("body/track")
    }
    known: dict[str, _Times] = {}
    tiers: dict[tuple[str, str], Tier] = {}
    for name, track in tracks.items():
        times, problem = _times(name, tracks, known)
        for i, element in enumerate(track.iterfind("el")):
            for attribute in element.iterfind("attribute"):
                key = name, attribute.get("name", "")
                tier = tiers.setdefault(key, Tier(*key, problem=problem))
                if not problem:
                    place = f"track {name}, element {i}"
                    tier.entries.append(Entry(*times[i], (attribute.text or "").strip(), place))
    return list(tiers.values())


def _times(
    name: str, tracks: dict[str, Element], known: dict[str, _Times], depth: int = 0
) -> _Times:
    """(start, end) of every element of a track in seconds, or why they can't be known."""
    if name not in known:
        track = tracks[name]
        kind, ref = track.get("type", "primary").lower(), track.get("ref", "")
        if kind == "primary":
            known[name] = _own_times(name, track), ""
        elif kind not in ("span", "singleton"):
            known[name] = [], f"its elements have no times of their own (type {kind!r})"
        elif ref not in tracks or depth == MAX_REFERENCES:
            known[name] = [], f"it refers to the track {ref!r}, which can't be followed"
        else:
            base, problem = _times(ref, tracks, known, depth + 1)
            known[name] = (
                ([], f"it refers to the track {ref!r}: {problem}")
                if problem
                else (_referred_times(name, track, tracks[ref], base), "")
            )
    return known[name]


def _own_times(name: str, track: Element) -> list[tuple[float, float]]:
    return [
        (
            read_time(element.get("start"), f"track {name}, element {i}"),
            read_time(element.get("end"), f"track {name}, element {i}"),
        )
        for i, element in enumerate(track.iterfind("el"))
    ]


def _referred_times(
    name: str, track: Element, base: Element, base_times: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    by_index = {
        element.get("index", str(i)): times
        for i, (element, times) in enumerate(zip(base.iterfind("el"), base_times, strict=True))
    }
    times = []
    for i, element in enumerate(track.iterfind("el")):
        first = element.get("start", element.get("ref"))
        last = element.get("end", element.get("ref"))
        if first not in by_index or last not in by_index:
            raise ContentError(
                f"refers to elements {first!r} to {last!r} of the track {track.get('ref')!r}, which"
                f" has {len(by_index)}",
                f"track {name}, element {i}",
            )
        times.append((by_index[first][0], by_index[last][1]))
    return times
