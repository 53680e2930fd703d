"""One self-contained HTML page about a prepared corpus, to judge whether its data is sane."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.files import write_text
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.corpus_report.distributions import (
    body_section,
    histograms_section,
    phases_section,
)
from cospeech.reporting.corpus_report.figures import figure_scale
from cospeech.reporting.corpus_report.listings import (
    joints_section,
    speakers_section,
    unusual_section,
    words_section,
)
from cospeech.reporting.corpus_report.overview import dropped_section, splits_section, tiles
from cospeech.reporting.corpus_report.statistics import corpus_statistics
from cospeech.reporting.corpus_report.windows import choose_windows, draw_window
from cospeech.reporting.markup import escaped, html_facts, html_page, html_sections

WINDOWS_DRAWN = 10

_SHEET = files("cospeech.reporting.corpus_report") / "corpus.css"


def write_corpus_report(store: Store, path: Path, seed: int = 0) -> None:
    """Write the page: totals, what was dropped, what stands apart, distributions, ten windows.

    Every recording is read once, one at a time, so memory does not grow with the corpus.

    Args:
        store: The prepared corpus.
        path: The HTML file; replaced only when the new one is complete.
        seed: Seed of the windows' draw.
    """
    statistics = corpus_statistics(store)
    drawn = choose_windows(store, WINDOWS_DRAWN, seed)
    sections = [
        ("splits", "Splits", splits_section(store, statistics)),
        ("dropped", "Kept and dropped", dropped_section(store, statistics.total)),
        ("unusual", "Recordings that stand apart", unusual_section(store, statistics)),
        ("windows", "Ten windows, drawn at random", _windows(store, drawn, seed)),
        ("distributions", "Distributions", histograms_section(store, statistics)),
        ("body", "Body and hands", body_section(store, statistics, [span for _, span in drawn])),
        ("joints", "Joint by joint", joints_section(store, statistics)),
        ("phases", "Gesture phases", phases_section(store, statistics)),
        ("words", "Words", words_section(store, statistics)),
        ("speakers", "Speakers", speakers_section(store, statistics)),
        ("made", "How it was made", _made(store)),
    ]
    name = escaped(store.name)
    body = [
        f"<h1>{name}</h1>",
        f'<p class="muted">{_subtitle(store)}</p>',
        tiles(store, statistics),
        *html_sections(sections),
    ]
    write_text(path, html_page(f"{name}: corpus", body, _SHEET))


def _subtitle(store: Store) -> str:
    licences = sorted({recording.licence for recording in store.recordings} - {""})
    licence = ", ".join(licences[:3]) + (" ..." if len(licences) > 3 else "")
    return (
        f"A prepared corpus: {escaped(_rates(store))};"
        f" {escaped(_skeleton_names(store))}; licence:"
        f" {escaped(licence) or 'not stated'}; fingerprint"
        f" <code>{escaped(store.fingerprint[:12])}</code>"
    )


def _rates(store: Store) -> str:
    counts = Counter(recording.fps for recording in store.recordings)
    rates = [f"{fps:g}" for fps, _ in counts.most_common(4)]
    more = f" and {len(counts) - 4} more rates" if len(counts) > 4 else ""
    kind = "3-D motion" if store.dimensions == 3 else "2-D keypoints"
    return f"{kind} at {', '.join(rates)}{more} frames/s"


def _skeleton_names(store: Store) -> str:
    names = [f"{skeleton.name} ({len(skeleton)} joints)" for skeleton in store.skeletons[:3]]
    more = f" and {len(store.skeletons) - 3} more" if len(store.skeletons) > 3 else ""
    return f"skeleton {', '.join(names)}{more}"


def _windows(store: Store, drawn: Sequence[tuple[str, Span]], seed: int) -> str:
    if not drawn:
        return "<section>No split has any motion.</section>"
    by_skeleton: dict[int, list[Span]] = {}
    for _, span in drawn:
        by_skeleton.setdefault(store.recordings[span.recording].skeleton, []).append(span)
    scales = {key: figure_scale(store, spans) for key, spans in by_skeleton.items()}
    parts = [
        '<p class="muted">Figures stand at their moment, wrists trail the way since the figure'
        ' before; <i class="swatch left"></i>orange is the speaker\'s left arm,'
        ' <i class="swatch right"></i>blue the right. The front view looks at the speaker'
        + (", the side view from the speaker's right" if store.dimensions == 3 else "")
        + f"; legs are left out. Sizes compare between windows. Seed of the draw: {seed}.</p>"
    ]
    for split, span in drawn:
        stored = store.recordings[span.recording]
        start = span.start / EVALUATION_FPS
        length = (span.stop - span.start) / EVALUATION_FPS
        title = (
            f"{escaped(stored.id)}<small>{escaped(stored.speaker)} · {escaped(split)}"
            f" · from {int(start // 60)}:{start % 60:05.2f} for {length:.2f} s</small>"
        )
        picture = draw_window(store, span, scales[stored.skeleton])
        parts.append(f'<div class="panel wide"><h3>{title}</h3>{picture}</div>')
    return "".join(parts)


def _made(store: Store) -> str:
    manifest = store.manifest
    space = (
        "metres, +x the speaker's left, +y up, +z forward"
        if store.dimensions == 3
        else "pixels, +x the speaker's left, +y up"
    )
    kept = (
        f"also as the ten evaluation joints at {EVALUATION_FPS:g} frames/s, spine at the origin,"
        " heading removed"
        if store.has_upper_body
        else "the ten evaluation joints can't be had from it, so the methods and metrics that need"
        " them don't apply"
    )
    audio = any(recording.has_audio for recording in store.recordings)
    sound = f"mono, {manifest['sample_rate']:,} Hz, 16 bit" if audio else "none"
    dialogues = sum(recording.has_interlocutor for recording in store.recordings)
    facts = [
        ("store", store.path.name),
        ("schema", str(manifest["schema"])),
        ("fingerprint", store.fingerprint),
        ("sources", f"{manifest['sources']:,}"),
        ("motion", f"{_rates(store)}, kept at that rate; {space}; {kept}"),
        ("skeletons", _skeleton_names(store)),
        ("audio", sound),
        ("dialogue", f"the other side is there in {dialogues:,} recordings"),
    ]
    covered = "<details><summary>what the fingerprint covers</summary><pre>{}</pre></details>"
    settings = json.dumps(manifest["parameters"], indent=1, ensure_ascii=False)[:20_000]
    shown = [(key, escaped(value)) for key, value in facts]
    listed = html_facts([*shown, ("settings", covered.format(escaped(settings)))])
    return f"<section>{listed}</section>"
