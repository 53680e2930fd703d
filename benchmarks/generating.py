"""How fast motion is generated from speech that is all there, and from speech as it comes.

Test recordings of the embedded corpus, one after the other until they last long enough, go through
the search alone (``knn``) and with its refinement (``knn_cgan``, with the quick variant's widths
and the published ones). Beside them, in the same run: the refinement's network alone, piece by
piece as a stream shows it, and one pass of it over all of the frames. Networks are not trained,
which costs the same. Times are of the processor, the median of several turns; the corpus and the
matching database are made on first use.

Prints a table and, as the last line, the same as JSON. Run: python benchmarks/generating.py
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.methods.base import GestureMethod
from cospeech.methods.motion_matching.refinement.module import RefinedMotionMatching
from cospeech.nn.modes import evaluating
from cospeech.speech.speech import SAMPLE_RATE, Speech

MODELS = {
    "knn": ["model=knn"],
    "knn_cgan, quick": ["model=knn_cgan", "experiment=knn_cgan_quick"],
    "knn_cgan": ["model=knn_cgan"],
}

PUSHED = SAMPLE_RATE // 10
"""Samples at a time, of speech as it comes."""


def settings(overrides: list[str]) -> Any:
    """What train.py would be run with."""
    conf = Path(__file__).resolve().parents[1] / "conf"
    with initialize_config_dir(str(conf), version_base="1.3"):
        return compose("train", overrides=overrides)


def pushed(method: GestureMethod, speech: Speech) -> None:
    """Let it hear the speech as it comes."""
    stream = method.open()
    for first in range(0, len(speech.waveform), PUSHED):
        stream.push(speech.waveform[first : first + PUSHED])
    stream.finish()


@torch.no_grad()
def in_pieces(method: RefinedMotionMatching, sound: torch.Tensor, poses: torch.Tensor) -> None:
    """Show all frames to the network as a stream does."""
    method.speaking.piecewise()(sound, poses, True)


@torch.no_grad()
def in_one_pass(method: RefinedMotionMatching, sound: torch.Tensor, poses: torch.Tensor) -> None:
    """Show all frames to the network at once."""
    with evaluating(method.speaking):
        method.speaking(sound[None], poses[None])


def seconds(function: Callable[..., object], *arguments: Any, turns: int) -> float:
    """Median processor time of calls, after one that isn't counted."""
    function(*arguments)
    times = []
    for _ in range(turns):
        began = time.process_time()
        function(*arguments)
        times.append(time.process_time() - began)
    return statistics.median(times)


def measure(method: GestureMethod, speech: Speech, turns: int) -> dict[str, float]:
    """Every number of one method, s."""
    row = {
        "generate_s": seconds(method.generate, speech, turns=turns),
        "pushed_s": seconds(pushed, method, speech, turns=turns),
    }
    if isinstance(method, RefinedMotionMatching):
        frames = len(method.generate(speech))
        channels = method.scales.audio_mean, method.scales.pose_mean
        shown = [torch.randn(frames, len(channel)) for channel in channels]
        row["network_in_pieces_s"] = seconds(in_pieces, method, *shown, turns=turns)
        row["network_in_one_pass_s"] = seconds(in_one_pass, method, *shown, turns=turns)
    return row


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=8, help="of speech")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1, help="of the networks")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)

    store = instantiate(settings(MODELS["knn"]).data).prepare_store()
    recordings = [store.speech(span).waveform for span in store.splits["test"]]
    waveform = np.resize(np.concatenate(recordings), round(arguments.minutes * 60 * SAMPLE_RATE))
    rows = {}
    for name, overrides in MODELS.items():
        torch.manual_seed(0)
        model = settings(overrides).model
        method = instantiate(model, corpus=store.facts(), _convert_="all").eval()
        rows[name] = measure(method, Speech(waveform, None), arguments.turns)

    real_s = 60 * arguments.minutes
    print(f"{arguments.minutes:g} min of speech, processor seconds (times real time)")
    print("| model | generate | pushed in tenths of a second | network in pieces | in one pass |")
    print("| --- " + "| ---: " * 4 + "|")
    for name, row in rows.items():
        cells = [f"{value:.2f} ({real_s / value:,.0f})" for value in row.values()]
        print(f"| {name} | " + " | ".join([*cells, "", ""][:4]) + " |")
    for name, row in rows.items():
        if one_pass := row.get("network_in_one_pass_s"):
            print(
                f"{name}: generate takes {row['generate_s'] / one_pass:.1f} passes of the network,"
                f" the network in pieces {row['network_in_pieces_s'] / one_pass:.1f},"
                f" and generate {row['generate_s'] / rows['knn']['generate_s']:.2f} of the search"
            )
    print(json.dumps({"benchmark": "generating", "speech_s": real_s, "rows": rows}))


if __name__ == "__main__":
    main()
