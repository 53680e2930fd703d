"""Disturbs real motion and looks at what metrics make of it, over a prepared corpus."""

from __future__ import annotations

from pathlib import Path

from cospeech.corpus.store import Store
from cospeech.evaluation import real_windows
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.noise_study import plot_noise_study, run_noise_study
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import format_table


def fgd_noise(
    store: Store, encoder: GestureEncoder, split: str, folder: Path, seed: int
) -> dict[str, list[dict[str, object]]]:
    """What known disturbances do to FGD and to joint error (Yoon et al. 2020, section 5.2).

    Prints the table and writes ``fgd_noise.json`` and ``fgd_noise.png`` (the paper's figure 4).

    Args:
        store: The corpus.
        encoder: The evaluation space.
        split: The split whose windows are disturbed.
        folder: Where the files go.
        seed: Of all draws.
    """
    positions, _ = real_windows(store, store.splits[split])
    rows = run_noise_study(encoder, positions, seed)
    values = [dict(row._asdict()) for row in rows]
    result: dict[str, list[dict[str, object]]] = {"rows": values}
    write_json(
        folder / "fgd_noise.json",
        {
            "corpus": store.name,
            "fingerprint": store.fingerprint,
            "split": split,
            "windows": len(positions),
            "encoder": {"sha256": encoder.sha256, "source": encoder.source},
            **result,
        },
    )
    print(format_table([{**row, "zeta": f"{row['zeta']:g}"} for row in values]))
    picture = folder / "fgd_noise.png"
    plot_noise_study(rows, picture)
    print(f"\n{len(positions)} {split} windows of {store.name}; figure: {picture}")
    return result
