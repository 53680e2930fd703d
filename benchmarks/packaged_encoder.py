"""What encoders of the embedded corpus restore and tell apart; how the packaged one is made.

Prints a row per encoder, the packaged one and those that are named, over the corpus's test split
(made on first use), and as the last line the same numbers as JSON.

    python benchmarks/packaged_encoder.py
    python benchmarks/packaged_encoder.py outputs/runs/ID/encoder.pt ...

With --package RUN, a finished run of model=motion_autoencoder on data=synthetic, that run's encoder
becomes the packaged one, with its recipe beside it.

Run from the repository's root.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import torch
from hydra import compose, initialize_config_dir

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from cospeech.corpus.splits import Span  # noqa: E402
from cospeech.corpus.store import Store  # noqa: E402
from cospeech.evaluation import reference_rows  # noqa: E402
from cospeech.evaluation.real_windows import long_enough, real_windows  # noqa: E402
from cospeech.experiment.building import build, chosen_catalogue  # noqa: E402
from cospeech.metrics.encoder import (  # noqa: E402
    GestureEncoder,
    load_any,
    packaged_encoder,
    save_encoder,
)
from cospeech.metrics.encoder.packaged import RECIPE, WEIGHTS  # noqa: E402
from cospeech.reporting.record import load_record, write_json  # noqa: E402
from cospeech.reporting.tables import format_table  # noqa: E402

ROWS = ("real_halves", "mean_pose", "noise", "attenuated", "frozen_arms", "time_reversed")


def main() -> None:
    """Measure, or package."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="further encoders to measure")
    parser.add_argument("--package", type=Path, metavar="RUN", help="run to package the encoder of")
    parser.add_argument("--outputs", default="outputs", help="outputs_dir, where the corpus lies")
    arguments = parser.parse_args()
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        given = ["data=synthetic", f"outputs_dir={arguments.outputs}"]
        cfg = compose("evaluate", given)
    store = build(cfg.data).prepare_store()
    if arguments.package is not None:
        package(arguments.package, store)
        return
    catalogue = chosen_catalogue(cfg.metrics)
    named = {"packaged": packaged_encoder()} | {str(f): load_any(f) for f in arguments.files}
    table = []
    for name, encoder in named.items():
        rows = reference_rows(store, encoder, "test", 0, catalogue)
        errors = {f"L1 {split}": restored(encoder, store, split) for split in ("train", "test")}
        found = {row: rows[row]["fgd"] for row in ROWS}
        table.append({"encoder": name, "sha256": encoder.sha256[:12], **errors, **found})
    print(format_table(table))
    print(json.dumps(table))


@torch.no_grad()
def restored(encoder: GestureEncoder, store: Store, split: str) -> float:
    """Mean L1 error of a split's windows encoded and decoded again, as ``val/reconstruction``."""
    features = encoder.to_features(real_windows(store, long_enough(store, split))[0])
    return float((encoder.network(features) - features).abs().mean())


def package(run: Path, store: Store) -> None:
    """Make a run's encoder the packaged one, and write what made it beside it."""
    record = load_record(run / "record.json", needs=("config", "versions", "hardware"))
    if record["status"] != "ok" or record["data_fingerprint"] != store.fingerprint:
        sys.exit(f"{run}: has not come to its end, or is of another corpus than data=synthetic")
    best = min(record["epochs"], key=lambda row: row["val/reconstruction"])
    config: dict[str, Any] = record["config"]
    epochs = f"{record['fit']['ended']} epochs on {store.name}"
    kept = load_any(run / "encoder.pt")
    encoder = GestureEncoder(
        kept.network,
        kept.mean_direction,
        kept.axes.tolist(),
        f"packaged: motion_autoencoder, {epochs}",
    )
    folder = "outputs/encoder"
    train = (
        "OMP_NUM_THREADS=1 python train.py model=motion_autoencoder data=synthetic trainer=cpu"
        f" training.epochs={config['training']['epochs']} seed={config['seed']} run_dir={folder}"
    )
    recipe = {
        "sha256": encoder.sha256,
        "commands": [train, f"python benchmarks/packaged_encoder.py --package {folder}"],
        "settings": {
            "model": config["model"],
            "training": config["training"],
            "seed": config["seed"],
        },
        "best_epoch": best["epoch"],
        "val/reconstruction": best["val/reconstruction"],
        "corpus": {
            "fingerprint": store.fingerprint,
            "parameters": store.manifest["parameters"],
            "first_take": first_take(encoder, store),
        },
        "commit": record["commit"],
        "versions": record["versions"],
        "hardware": {
            "device": record["hardware"]["device"],
            "torch_threads": record["hardware"]["torch_threads"],
            "instructions": torch.backends.cpu.get_cpu_capability(),
        },
    }
    save_encoder(encoder, WEIGHTS)
    write_json(RECIPE, recipe)
    print(f"{encoder.sha256[:12]} is in {WEIGHTS}")


def first_take(encoder: GestureEncoder, store: Store) -> dict[str, Any]:
    """The mean feature of the corpus's first take, by which other motion is noticed."""
    columns = store.recordings.columns
    windows = real_windows(store, [Span(0, 0, columns["frames"][0])])[0]
    return {"id": columns["id"][0], "mean_feature": encoder.encode_all(windows).mean(0).tolist()}


if __name__ == "__main__":
    main()
