"""Aligners' JSON, and plain lists of words."""

from __future__ import annotations

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, Entry
from cospeech.speech.transcript.json_shapes.items import (
    DURATION_KEYS,
    END_KEYS,
    START_KEYS,
    Document,
    Item,
    children,
    first,
    numbered,
)
from cospeech.speech.transcript.tiers import Tier, words_tier


def read_tiers(document: Document) -> Entries | None:
    """Montreal Forced Aligner: ``{"tiers": {"words": {"entries": [[start, end, label]]}}}``."""
    tiers = document.get("tiers")
    if not isinstance(tiers, dict):
        return None
    found = []
    for name, values in tiers.items():
        tier = Tier(name)
        for place, item in children(values, "entries", f"tiers.{name}"):
            if isinstance(item, list) and len(item) == 3:
                tier.entries.append(document.entry(place, [item[2], item[0], item[1]]))
        if tier.entries:
            found.append(tier)
    return Entries(tuple(words_tier(found).entries)) if found else Entries(())


def read_word_lists(document: Document) -> Entries | None:
    """Gentle and others: ``{"words": [...]}``, or a list of words alone."""
    if isinstance(document.value, list):
        items = numbered(document.value)
    elif document.list_of("words") is not None:
        items = list(children(document.value, "words"))
    else:
        return None
    entries = tuple(document.entries(items))
    _require_times(document, items, entries)
    return Entries(entries)


def _require_times(document: Document, items: list[Item], entries: tuple[Entry, ...]) -> None:
    if not entries or any(entry.is_timed for entry in entries):
        return
    timed = (*START_KEYS, *END_KEYS, *DURATION_KEYS)
    item = items[0][1]
    if isinstance(item, dict) and first(item, timed) is None and "case" not in item:
        keys = ", ".join(map(repr, list(item)[:8]))
        raise ContentError(
            f"its words have no times under a name that is known (they have {keys:.200})",
            items[0][0],
            f"times are called {', '.join((*START_KEYS[:3], *END_KEYS[:3], *DURATION_KEYS))}",
        )
