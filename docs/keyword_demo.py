"""Draw docs/keyword_demo.png: what a keyword does to the gestures of a held-out recording.

Run: python docs/keyword_demo.py STORE, the folder of the embedded corpus's prepared store.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.matching.control import Controls, WordPattern, measure
from cospeech.methods.motion_matching import MotionMatching
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.charts import chart_style, colour, draw_bones, new_figure, save_picture
from cospeech.speech.speech import Word

KEYWORD = "huge|enormous|giant|massive|big|large|wide|gigantic|vast"
AROUND_S = (0.2, 0.3)
"""Seconds before a word's onset and after its end in which its gesture is looked for."""


def poses_of(
    method: MotionMatching, store: Store, span: Span, seed: int, controls: Controls | None
) -> np.ndarray:
    """``(T, J, 3)`` of the database's roles, metres."""
    speaker = store.recordings[span.recording].speaker
    generator = torch.Generator().manual_seed(seed)
    return method.stages(store.speech(span), controls, generator, speaker)["k-NN"]


def hands_distances(method: MotionMatching, poses: np.ndarray) -> np.ndarray:
    """Distance of the hands in each frame, metres."""
    return measure("hands_distance", poses, method.database.pose_roles, method.window.fps)


def around(word: Word, fps: float) -> slice:
    """Frames around a word."""
    first = max(0, int((word.start - AROUND_S[0]) * fps))
    return slice(first, int((word.end + AROUND_S[1]) * fps) + 1)


def main() -> None:
    """Measure over all held-out recordings, draw one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("store", type=Path)
    parser.add_argument("--shown", default="syn-020-s05", help="the recording that is drawn")
    parser.add_argument("--seconds", type=float, nargs=2, default=(10.0, 45.0))
    arguments = parser.parse_args()
    store = Store(arguments.store)
    method = MotionMatching(store.facts(), seam="crossfade")
    controls = Controls.from_dict([{"word": KEYWORD}])
    pattern, fps = WordPattern(KEYWORD), method.window.fps
    found: dict[str, list[float]] = {"without": [], "with": []}
    for number, span in enumerate([*store.splits["test"], *store.splits["val"]]):
        poses = {
            "without": poses_of(method, store, span, number, None),
            "with": poses_of(method, store, span, number, controls),
        }
        words = [word for word in store.speech(span).words or () if pattern.matches(word.text)]
        for name, made in poses.items():
            distances = hands_distances(method, made)
            found[name] += [float(distances[around(word, fps)].max()) for word in words]
        if store.recordings[span.recording].id == arguments.shown:
            draw(method, poses, words, arguments.seconds)
    for name, values in found.items():
        print(
            f"{name} the keyword: hands {100 * np.mean(values):.1f} cm apart at {len(values)} words"
        )
    changes = np.subtract(found["with"], found["without"])
    error = changes.std(ddof=1) / np.sqrt(len(changes))
    print(f"change: {100 * changes.mean():.1f} cm, standard error {100 * error:.1f} cm")


@chart_style()
def draw(
    method: MotionMatching,
    poses: dict[str, np.ndarray],
    words: list[Word],
    seconds: tuple[float, float],
) -> None:
    """One recording's curves, the keywords as bands, and both poses at one of them."""
    fps = method.window.fps
    figure = new_figure(792, 245, "constrained")
    axis, *bodies = figure.subplots(1, 3, width_ratios=(4.4, 1, 1))
    shown = words[1]
    for (name, made), body in zip(poses.items(), bodies, strict=True):
        label = "no controls" if name == "without" else "with the keyword"
        distances = hands_distances(method, made)
        ink = colour(COLOURS[name])
        axis.plot(np.arange(len(made)) / fps, 100 * distances, label=label, color=ink)
        part = around(shown, fps)
        draw_body(body, method, made[part][distances[part].argmax()], ink)
        body.set_title(f"“{shown.text}”\n{label}", fontsize=9, loc="center")
    for number, word in enumerate(words):
        axis.axvspan(word.start - 0.2, word.end, color=colour("line"), zorder=0)
        if seconds[0] <= word.start <= seconds[1]:
            # Neighbours keep clear of one another.
            place = (
                {"x": word.end, "ha": "right"} if number % 2 else {"x": word.start, "ha": "left"}
            )
            top = axis.get_xaxis_transform()
            axis.text(y=1.02, s=word.text, transform=top, fontsize=9, **place)
    axis.set_xlim(seconds)
    axis.set_ylim(20, 98)
    axis.set_xlabel("s")
    axis.set_ylabel("distance of the hands, cm")
    axis.grid(axis="y")
    axis.legend(loc="upper left", ncols=2)
    save_picture(figure, Path(__file__).with_name("keyword_demo.png"))


COLOURS = {"without": "c8", "with": "c1"}


def draw_body(axis: Axes, method: MotionMatching, pose: np.ndarray, ink: str) -> None:
    """A pose from the front."""
    joints = method.database.upper_body(pose)[:, :2].astype(np.float64)
    draw_bones(axis, joints * [-1, 1], UPPER_BODY.bones, color=ink, linewidth=3)
    axis.set_aspect("equal")
    axis.set_xlim(-0.5, 0.5)
    axis.set_ylim(-0.3, 0.7)
    axis.axis("off")


if __name__ == "__main__":
    main()
