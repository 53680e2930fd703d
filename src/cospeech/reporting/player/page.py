"""Writing the player page."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from cospeech.errors import CospeechError
from cospeech.files import write_text
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASES
from cospeech.reporting.figure import PART_COLOURS, PARTS
from cospeech.reporting.markup import escaped, plain
from cospeech.reporting.player.encode import encode_audio, encode_tracks
from cospeech.speech.speech import Speech

PHASE_COLOURS: dict[str, str] = dict(
    zip(
        PHASES,
        (
            "#4fa8d8",  # preparation
            "#8fcbe8",  # pre_hold
            "#e4572e",  # stroke
            "#f2a65a",  # hold
            "#d9b44a",  # independent_hold
            "#9c89b8",  # rest_hold
            "#6fae75",  # partial_retract
            "#3f8f5b",  # retract
            "#8a93a0",  # none
        ),
        strict=True,
    )
)

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src {hash}; \
style-src 'unsafe-inline'; media-src blob:; img-src data:">
<title>{title}</title>
<style>
{css}
</style>
</head>
<body>
<script type="application/json" id="cospeech-data">{data}</script>
<script>{script}</script>
</body>
</html>
"""


@dataclass(frozen=True, eq=False)
class PlayerClip:
    """One clip of a player page.

    Attributes:
        name: Shown in the clip selector.
        tracks: Label (``"recorded"``, ``"generated"``) -> motion, drawn side by side in this
            order. Skeletons and frame rates may differ; frame i of each shows time ``i / fps``.
        speech: The sound, which is the clock, and the words of the transcript.
        phases: Track label -> one gesture-phase name per frame of that track; None for none.
        facts: Small table beside the clip (speaker, seed, checkpoint, numbers).
    """

    name: str
    tracks: Mapping[str, Motion]
    speech: Speech
    phases: Mapping[str, Sequence[str]] | None = None
    facts: Mapping[str, str] = field(default_factory=dict)


def script_safe_json(values: Any) -> str:
    """JSON that can stand inside a ``<script>`` element whatever the strings contain.

    ``<``, ``>``, ``&`` and the two line separators that end a line in JavaScript are written as
    escapes; what can't be shown is replaced; infinities and NaN, which JSON does not have, are
    refused.
    """
    text = plain(json.dumps(values, ensure_ascii=False, allow_nan=False, separators=(",", ":")))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _clip_values(clip: PlayerClip) -> dict[str, Any]:
    if not clip.tracks:
        raise CospeechError(f"clip {clip.name!r} has no motion", "give it at least one track")
    phases = clip.phases or {}
    unknown = set(phases) - set(clip.tracks)
    if unknown:
        raise CospeechError(
            f"clip {clip.name!r}: phases for {sorted(unknown)}, which it does not show",
            f"its tracks are {list(clip.tracks)}",
        )
    words = clip.speech.words
    return {
        "name": clip.name,
        "duration": max(
            clip.speech.duration, *(motion.duration for motion in clip.tracks.values())
        ),
        "audio": encode_audio(clip.speech),
        "words": None if words is None else [[w.text, float(w.start), float(w.end)] for w in words],
        "facts": [[str(key), str(value)] for key, value in clip.facts.items()],
        "tracks": encode_tracks(clip.tracks, phases),
    }


def write_player(
    path: str | Path, clips: Sequence[PlayerClip], title: str, notes: str = ""
) -> Path:
    """Write one HTML file that plays clips with sound, from disk, without a network.

    The page holds everything: motion, sound, words and the drawing code. Its content security
    policy lets it load nothing and run nothing else.

    Args:
        path: The HTML file; replaced only when the new one is complete.
        clips: At least one.
        title: Heading and browser-tab title.
        notes: A sentence or two under the heading.

    Returns:
        ``path``.

    Raises:
        CospeechError: No clips, a clip without tracks, motion that is empty or not finite, phase
            labels that do not fit, or the file can't be written.
    """
    if not clips:
        raise CospeechError("no clips to show", "pass at least one PlayerClip")
    assets = files("cospeech.reporting.player")
    script = (assets / "player.bundle.js").read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    values = {
        "title": title,
        "notes": notes,
        "partColours": [PART_COLOURS[part] for part in PARTS],
        "phaseColours": PHASE_COLOURS,
        "clips": [_clip_values(clip) for clip in clips],
    }
    page = _PAGE.format(
        hash=f"'sha256-{digest}'",
        title=escaped(title),
        css=(assets / "player.css").read_text(encoding="utf-8"),
        data=script_safe_json(values),
        script=script,
    )
    write_text(path, page)
    return Path(path)
