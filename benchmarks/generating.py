"""How fast motion is generated from speech that is all there, and from speech as it comes.

Test recordings of the embedded corpus, one after the other until they last long enough, go through
the search alone (``knn``) and with its refinement (``knn_cgan``, with the quick variant's widths
and the published ones). Beside them, in the same run: the refinement's network alone, piece by
piece as a stream shows it, and one pass of it over all of the frames. Networks are not trained,
which costs the same. Gesticulator goes with the recordings' words, without and with text. Times
are of the processor, the median of several turns; the corpus and the matching database are made on
first use.

A step is what it takes to push one frame's sound, in the first minute: features, network, motion.

Prints a table and, as the last line, the same as JSON. Run: python benchmarks/generating.py
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.corpus.store import Store
from cospeech.methods.base import GestureMethod
from cospeech.methods.motion_matching.refinement.module import RefinedMotionMatching
from cospeech.nn.modes import evaluating
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

MODELS = {
    "knn": ["model=knn"],
    "knn_cgan, quick": ["model=knn_cgan", "experiment=knn_cgan_quick"],
    "knn_cgan": ["model=knn_cgan"],
    "gesticulator, no text": ["model=gesticulator", "model.text=none"],
    "gesticulator": ["model=gesticulator"],
}

PUSHED = SAMPLE_RATE // 10
"""Samples at a time, of speech as it comes."""


def settings(overrides: list[str]) -> Any:
    """What train.py would be run with."""
    conf = Path(__file__).resolve().parents[1] / "conf"
    with initialize_config_dir(str(conf), version_base="1.3"):
        return compose("train", overrides=overrides)


def pushed(method: GestureMethod, speech: Speech, samples: int = PUSHED) -> None:
    """Let it hear the speech as it comes."""
    stream = method.open()
    for first in range(0, len(speech.waveform), samples):
        until_s = (first + samples) / SAMPLE_RATE
        begun = [w for w in speech.words or () if first / SAMPLE_RATE <= w.start < until_s]
        stream.push(speech.waveform[first : first + samples], begun)
    stream.finish()


def one_after_another(store: Store, seconds: float) -> Speech:
    """The test recordings and their words, again and again until they last long enough."""
    waveforms, words = list[np.ndarray](), list[Word]()
    begin_s = 0.0
    for span in cycle(store.splits["test"]):
        speech = store.speech(span)
        waveforms.append(speech.waveform)
        words += [Word(w.text, w.start + begin_s, w.end + begin_s) for w in speech.words or ()]
        begin_s += speech.duration
        if begin_s >= seconds:
            break
    waveform = np.concatenate(waveforms)[: round(seconds * SAMPLE_RATE)]
    return Speech(waveform, tuple(word for word in words if word.start < seconds))


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


def one_minute(speech: Speech) -> Speech:
    """Its first minute."""
    words = tuple(word for word in speech.words or () if word.start < 60)
    return Speech(speech.waveform[: 60 * SAMPLE_RATE], words)


def measure(method: GestureMethod, speech: Speech, turns: int) -> dict[str, float]:
    """Every number of one method, s."""
    row = {
        "generate_s": seconds(method.generate, speech, turns=turns),
        "pushed_s": seconds(pushed, method, speech, turns=turns),
    }
    minute = one_minute(speech)
    frame_samples = round(SAMPLE_RATE / method.window.fps)
    frames = minute.duration * method.window.fps
    row["step_s"] = seconds(pushed, method, minute, frame_samples, turns=turns) / frames
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
    parser.add_argument("--models", nargs="+", choices=MODELS, default=list(MODELS))
    parser.add_argument("--threads", type=int, default=1, help="of the networks")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)

    store = instantiate(settings(MODELS["knn"]).data).prepare_store()
    speech = one_after_another(store, arguments.minutes * 60)
    rows = {}
    for name in arguments.models:
        overrides = MODELS[name]
        torch.manual_seed(0)
        model = settings(overrides).model
        method = instantiate(model, corpus=store.facts(), _convert_="all").eval()
        rows[name] = measure(method, speech, arguments.turns)

    real_s = 60 * arguments.minutes
    print(f"{arguments.minutes:g} min of speech, processor seconds (times real time)")
    print(
        "| model | generate | pushed in tenths of a second | a step | network in pieces"
        " | in one pass |"
    )
    print("| --- " + "| ---: " * 5 + "|")
    for name, row in rows.items():
        step = f"{1e3 * row['step_s']:.2f} ms"
        cells = [
            f"{value:.2f} ({real_s / value:,.0f})" for key, value in row.items() if key != "step_s"
        ]
        cells.insert(2, step)
        print(f"| {name} | " + " | ".join([*cells, "", ""][:5]) + " |")
    for name, row in rows.items():
        if "knn" in rows and (one_pass := row.get("network_in_one_pass_s")):
            print(
                f"{name}: generate takes {row['generate_s'] / one_pass:.1f} passes of the network,"
                f" the network in pieces {row['network_in_pieces_s'] / one_pass:.1f},"
                f" and generate {row['generate_s'] / rows['knn']['generate_s']:.2f} of the search"
            )
    print(json.dumps({"benchmark": "generating", "speech_s": real_s, "rows": rows}))


if __name__ == "__main__":
    main()
