"""Run folders with records as `train.py` leaves them."""

import json
import re


def record(folder, seed=0, ablation="full", fgd=2.0, weight=5.0, **changes):
    """A new run folder; its record has the changes."""
    name = f"trimodal-synthetic-{ablation}-s{seed}"
    values = {
        "schema": 1,
        "id": name,
        "status": "ok",
        "model": "trimodal",
        "data": "synthetic",
        "ablation": ablation,
        "seed": seed,
        "started": "2026-01-01T00:00:00+00:00",
        "finished": "2026-01-01T01:00:00+00:00",
        "config": {
            "seed": seed,
            "run_dir": f"outputs/runs/{name}",
            "choices": {"ablation": ablation},
            "model": {"loss": {"adversarial": weight}, "width": 8, "seed": seed},
            "logger": {"csv": {"save_dir": f"outputs/runs/{name}"}},
            "trainer": {"default_root_dir": f"outputs/runs/{name}/x"},
        },
        "commit": "0123456789abcdef",
        "dirty": False,
        "versions": {"torch": "2.13"},
        "data_fingerprint": "corpus-1",
        "encoder": {"sha256": "encoder-1", "name": "own"},
        "timings": {"fit": 90.0, "test": 30.0},
        "epochs": [{"epoch": e, "val/fgd": fgd + 10 - e, "val/joint_mae": 0.1} for e in range(5)],
        "fit": {"asked": 5, "ended": 5},
        "final": {"split": "test", "windows": {"fgd": fgd}, "recordings": {"fgd": fgd + 1}},
        "references": {"real_halves": {"fgd": 0.25}, "mean_pose": {"fgd": 9.0}},
        "samples": [],
        "error": None,
    } | changes
    kept = re.sub(r"[^\w-]", "-", name, flags=re.ASCII)[:100]
    run = folder / f"{kept}-{len(list(folder.iterdir()))}"
    run.mkdir(parents=True)
    (run / "record.json").write_text(json.dumps(values))
    return run
