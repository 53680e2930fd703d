"""What a store says of itself, written with checksums and read as what anybody may have changed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, get_args, get_type_hints

from cospeech.corpus.packing import STREAMS
from cospeech.corpus.recording_table import RECORDING_FACTS, StoredRecording
from cospeech.errors import InputFileError
from cospeech.files import write_json
from cospeech.foreign import parse_json, read_bytes, understood

MANIFEST, VOCABULARY, CHECKSUMS = "manifest.json", "vocabulary.json", "checksums.json"
MOST_BYTES = 2**29
"""A corpus of a quarter of a million recordings has a manifest of some 60 MB."""
MOST_CONTAINERS = 4_000_000
"""Each span of a split is a list, of which a recording may have three; what was left out counts,
too."""


def rebuild(folder: Path) -> str:
    """What to do about a store that is damaged."""
    return f"delete {folder} and start again: it will be rebuilt"


def write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    """Write a store's manifest, and the checksums of it and the vocabulary that lies there."""
    write_json(folder / MANIFEST, manifest)
    write_checksums(folder)


def write_checksums(folder: Path) -> None:
    """Write the checksums of a store's manifest and vocabulary."""
    sums = {name: _sha256((folder / name).read_bytes()) for name in (MANIFEST, VOCABULARY)}
    write_json(folder / CHECKSUMS, sums)


def read_manifest(folder: Path, schema: int) -> dict[str, Any]:
    """A store's manifest; what `Store` relies on is there and of its type.

    Args:
        folder: The store.
        schema: The version that is read.

    Raises:
        InputFileError: There is no store, it is of another version, or its manifest isn't what was
            written.
    """
    path, hint = folder / MANIFEST, rebuild(folder)
    if not path.is_file():
        raise InputFileError(folder, "not a store (no manifest.json)")
    data = read_bytes(path, "a store's manifest", MOST_BYTES, hint)
    with understood(path, "a store's manifest", hint):
        text = data.decode("utf-8")
        manifest = parse_json(path, text, "a store's manifest", hint, MOST_CONTAINERS)
        _require(isinstance(manifest, dict), "an object")
        if manifest.get("schema") != schema:
            problem = f"schema {manifest.get('schema')!r:.40}, this version reads {schema}"
            raise InputFileError(path, problem, hint=hint)
        _require_sum(path, data, hint)
        _check(manifest)
    return manifest


def read_vocabulary(folder: Path) -> list[str]:
    """A store's words; a word's id is its index.

    Raises:
        InputFileError: It isn't what was written.
    """
    path, hint = folder / VOCABULARY, rebuild(folder)
    data = read_bytes(path, "a store's vocabulary", MOST_BYTES, hint)
    _require_sum(path, data, hint)
    with understood(path, "a store's vocabulary", hint):
        words = parse_json(path, data.decode("utf-8"), "a store's vocabulary", hint)
        _require(_all_of(words, str), "a list of words")
    return words


def _require_sum(path: Path, data: bytes, hint: str) -> None:
    kept = path.with_name(CHECKSUMS)
    text = read_bytes(kept, "checksums", 2**16, hint)
    with understood(kept, "checksums of a store", hint):
        expected = parse_json(kept, text.decode("utf-8"), "checksums", hint)[path.name]
    if _sha256(data) != expected:
        raise InputFileError(path, "damaged: it isn't what was written", hint=hint)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _check(manifest: dict[str, Any]) -> None:
    """Refuse what would fail later, or say something wrong, inside whoever uses it."""
    for name, kind in (
        ("name", str),
        ("fingerprint", str),
        ("parameters", dict),
        ("remarks", list),
        ("dimensions", int),
        ("has_upper_body", bool),
        ("statistics", dict),
        ("skipped", list),
        ("dropped_windows", dict),
        ("sources", int),
    ):
        _require(type(manifest[name]) is kind, f"a {kind.__name__}", name)
    _require(manifest["dimensions"] in (2, 3), "2 or 3", "dimensions")
    _require(_all_of(manifest["speakers"], str), "a list of names", "speakers")
    grid = manifest["window_grid"]
    _require(grid is None or isinstance(grid, dict), "an object or null", "window_grid")
    columns, count = manifest["recordings"], len(manifest["recordings"]["id"])
    hints = get_type_hints(StoredRecording)
    for name in RECORDING_FACTS:
        kinds = get_args(hints[name]) or (hints[name],)
        if float in kinds:
            kinds = (*kinds, int)
        fits = _all_of(columns[name], *kinds) and len(columns[name]) == count
        _require(fits, f"{count} values of their type", f"recordings.{name}")
    skeletons = len(manifest["skeletons"])
    _require(skeletons > 0, "a list with an entry", "skeletons")
    inside = all(0 <= index < skeletons for index in columns["skeleton"])
    _require(inside, "indices of skeletons", "recordings.skeleton")
    _require(all(fps > 0 for fps in columns["fps"]), "rates above 0", "recordings.fps")
    _check_streams(manifest, count)
    for name, spans in manifest["splits"].items():
        for span in spans:
            fits = _all_of(span, int) and len(span) == 3 and 0 <= span[0] < count
            _require(
                fits and 0 <= span[1] <= span[2] <= columns["frames"][span[0]],
                "[recording, first frame, frame after the last]",
                f"splits.{name}",
            )


def _check_streams(manifest: dict[str, Any], count: int) -> None:
    for stream, (dtype, width) in STREAMS.items():
        width = manifest["dimensions"] if stream == "positions" else width
        rows = manifest["rows"][stream]
        fits = _all_of(rows, int) and len(rows) == count and min(rows, default=0) >= 0
        _require(fits, f"{count} counts", f"rows.{stream}")
        facts = {"dtype": dtype, "width": width, "rows": sum(rows)}
        told = json.dumps(manifest["streams"][stream], sort_keys=True)  # where true isn't 1
        _require(told == json.dumps(facts, sort_keys=True), str(facts), f"streams.{stream}")
    _require(manifest["streams"].keys() == STREAMS.keys(), f"{', '.join(STREAMS)}", "streams")
    rows, columns = manifest["rows"], manifest["recordings"]
    joints = [len(manifest["skeletons"][index]["joints"]) for index in columns["skeleton"]]
    for i, is_turned in enumerate(columns["has_rotations"]):
        fits = rows["rotations_local"][i] == (rows["positions"][i] if is_turned else 0)
        _require(fits, "as many as positions where there are any", "rows.rotations_local")
        _require(rows["rest_offsets"][i] in (0, joints[i]), "one a joint", "rows.rest_offsets")


def _all_of(values: Any, *kinds: type) -> bool:
    return isinstance(values, list) and set(map(type, values)) <= set(kinds)


def _require(fits: bool, what: str, name: str = "the manifest") -> None:
    if not fits:
        raise ValueError(f"{name} is not {what}")
