"""How well the windows of long speech are joined by each way a multi_adversary run has.

The size of the step where windows meet (a crossfade has two such places: where it begins and where
it ends), over the median step elsewhere, mean over joints, on the test recordings of the run's
corpus; the median step within a fade, over the same; and how fast motion is generated. Prints a
table and, as the last line, the same as JSON.
Run: python benchmarks/long_form.py outputs/runs/multi_adversary-...
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, get_args

import numpy as np
from hydra.utils import instantiate
from numpy.typing import NDArray
from omegaconf import OmegaConf

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.multi_adversary.synthesis import OVERLAP_FRAMES, LongForm
from cospeech.speech.speech import Speech


def seams(method: MultiAdversary, speech: list[Speech]) -> dict[str, Any]:
    """Steps where windows meet over the median step elsewhere."""
    window = method.window.frames
    crossfade = method.long_form == "crossfade"
    starts = window - OVERLAP_FRAMES if crossfade else window
    places = (0, OVERLAP_FRAMES) if crossfade else (0,)
    border, fade, inside = list[NDArray[Any]](), list[NDArray[Any]](), list[NDArray[Any]]()
    began = time.perf_counter()
    for one in speech:
        positions = method.generate_joints(one).positions
        steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(-1)
        number = np.arange(1, len(positions))
        at_border = (number >= starts) & np.isin(number % starts, places)
        border.append(steps[at_border])
        fading = (number >= starts) & (number % starts < places[-1]) & ~at_border
        fade.append(steps[fading])
        inside.append(steps[~at_border & ~fading])
    elsewhere = np.concatenate(inside) / np.median(np.concatenate(inside))
    jumps = np.concatenate(border) / np.median(np.concatenate(inside))
    return {
        "median": float(np.median(jumps)),
        "p90": float(np.percentile(jumps, 90)),
        "inside_p90": float(np.percentile(elsewhere, 90)),
        "borders": len(jumps),
        "fade": _median_ratio(fade, inside) if crossfade else None,
        "seconds": time.perf_counter() - began,
    }


def _median_ratio(some: list[NDArray[Any]], others: list[NDArray[Any]]) -> float:
    return float(np.median(np.concatenate(some)) / np.median(np.concatenate(others)))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a finished multi_adversary run")
    run = parser.parse_args().run
    config = json.loads((run / "record.json").read_text())["config"]
    store = instantiate(OmegaConf.create(config["data"])).prepare_store()
    method = MultiAdversary.load_from_checkpoint(
        run / "checkpoints" / "last.ckpt", map_location="cpu", weights_only=True
    ).eval()
    speech = [store.speech(span) for span in store.splits["test"]]
    rows = {}
    for long_form in get_args(LongForm):
        method.long_form = long_form
        rows[long_form] = seams(method, speech)
    minutes = sum(len(one.waveform) for one in speech) / 16000 / 60
    print(f"{len(speech)} recordings, {minutes:.1f} min")
    print("| long form | median | 90 % | inside, 90 % | borders | within a fade | x real time |")
    print("| --- " + "| ---: " * 6 + "|")
    for name, row in rows.items():
        print(
            f"| {name} | {row['median']:.2f} | {row['p90']:.2f} | {row['inside_p90']:.2f} |"
            f" {row['borders']} | {'' if row['fade'] is None else format(row['fade'], '.2f')} |"
            f" {60 * minutes / row['seconds']:,.0f} |"
        )
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
