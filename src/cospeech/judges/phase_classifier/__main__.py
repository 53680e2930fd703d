"""``python -m cospeech.judges.phase_classifier``: label recordings, and score a classifier."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import SPLITS
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.formats.phase_files.writing import phase_segments, write_elan, write_phase_table
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.recording_scores import recording_scores
from cospeech.judges.phase_classifier.scores import PhaseScores
from cospeech.motion.bvh import UP_AXES, read_bvh, read_bvh_skeleton
from cospeech.motion.joint_map import find_joint_map, load_joint_map
from cospeech.motion.joint_map_values import UNIT_SCALES
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASE_INDEX, PHASES
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import Speech
from cospeech.terminal import exit_status, number_between

_PHASE_OF_CLASS = {"other": "none", "no_stroke": "none", "rest": "rest_hold"} | {
    "retraction": "retract"
}
"""The annotation label that stands for a class made of several."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status.

    Args:
        arguments: Command line; that of the process when None.
    """
    given = _parser().parse_args(arguments)
    logging.basicConfig(format="%(message)s")
    try:
        if given.command == "label":
            classifier = FrozenPhaseClassifier.load(given.classifier)
            _require_sound(classifier, given.audio)
            _label(classifier, _motion(given), given.motion.stem, given.audio, given.out)
        else:
            _score(given.classifier, given.store, given.split)
    except CospeechError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _require_sound(classifier: FrozenPhaseClassifier, audio_file: Path | None) -> None:
    if classifier.pitch and audio_file is None:
        raise CospeechError(
            "this classifier reads the pitch",
            "give the recording's sound with --audio, or use one trained with model.pitch=false",
        )


def _motion(given: argparse.Namespace) -> Motion:
    """The motion to label, as the command line says to read it."""
    if given.joint_map is None:
        joint_map = find_joint_map(read_bvh_skeleton(given.motion))
    else:
        joint_map = load_joint_map(given.joint_map)
    scale = joint_map.unit_scale if given.unit_scale is None else given.unit_scale
    motion = read_bvh(given.motion, unit_scale=scale, up_axis=given.up_axis)
    return replace(motion, skeleton=replace(motion.skeleton, joint_map=joint_map))


def _label(
    classifier: FrozenPhaseClassifier,
    motion: Motion,
    name: str,
    audio_file: Path | None,
    folder: Path,
) -> None:
    speech = None if audio_file is None else Speech(load_audio(audio_file))
    found = classifier.label(motion, speech)
    segments = phase_segments(_as_phases(classifier, found), motion.fps)
    # Different classes stand for different labels, so the segments are the same.
    starts = np.flatnonzero(np.diff(found, prepend=-1))
    names = [classifier.classes[index] for index in found[starts]]
    table = folder / f"{name}.phases.csv"
    document = folder / f"{name}.eaf"
    write_phase_table(table, segments, names)
    write_elan(document, segments, [] if audio_file is None else [audio_file])
    counts = np.bincount(found, minlength=len(classifier.classes)) / len(found)
    for name, share in zip(classifier.classes, counts, strict=True):
        print(f"{name:16} {100 * share:5.1f} %")
    print(f"\ntable: {table.resolve()}\nELAN:  {document.resolve()}")


def _score(classifier_files: list[Path], stores: list[Path], split: str) -> None:
    if len(classifier_files) != len(stores):
        raise CospeechError(
            f"{len(classifier_files)} classifiers and {len(stores)} stores",
            "give a classifier for each store, in the same order",
        )
    classifiers = [FrozenPhaseClassifier.load(file) for file in classifier_files]
    classes = classifiers[0].classes
    if any(classifier.classes != classes for classifier in classifiers):
        raise CospeechError("the classifiers have different classes, so they can't be summed")
    total = np.zeros((len(classes), len(classes)), dtype=np.int64)
    for classifier, store in zip(classifiers, stores, strict=True):
        total += recording_scores(classifier, Store(store), split).confusion
    print(PhaseScores.of(total).table(classes))


def _as_phases(classifier: FrozenPhaseClassifier, found: NDArray[np.int64]) -> NDArray[np.int64]:
    names = [_PHASE_OF_CLASS.get(name, name) for name in classifier.classes]
    return np.array([PHASE_INDEX[name] for name in names])[found]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m cospeech.judges.phase_classifier")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    label = commands.add_parser(
        "label",
        help="label a BVH file",
        description="Write the gesture phases of a BVH file as a table and as an ELAN document."
        f" The labels are those of annotation files ({', '.join(PHASES)}): the class 'other' is"
        " written as 'none', and the table has the class itself beside it.",
    )
    label.add_argument("motion", type=Path, metavar="FILE.bvh")
    label.add_argument("--audio", type=Path, metavar="FILE.wav", help="its sound")
    label.add_argument(
        "--joint-map", metavar="MAP", help="name or yaml of a joint map (by the joints' names)"
    )
    label.add_argument(
        "--unit-scale",
        type=number_between(*UNIT_SCALES),
        metavar="METRES",
        help="metres per unit of the BVH file (by the joint map)",
    )
    label.add_argument("--up-axis", choices=UP_AXES, default="y", help="its vertical axis")
    label.add_argument("--out", type=Path, required=True, metavar="DIR", help="where to write")
    score = commands.add_parser(
        "score",
        help="compare with a store's annotation",
        description="Label whole annotated recordings of a prepared store and compare every frame."
        " Of several stores (the folds of a cross-validation), the frames are pooled.",
    )
    score.add_argument(
        "store", type=Path, nargs="+", help="the store's folder (outputs/stores/...)"
    )
    score.add_argument("--split", choices=SPLITS, default="test")
    label.add_argument("--classifier", type=Path, required=True, help="phase_classifier.pt")
    score.add_argument(
        "--classifier", type=Path, nargs="+", required=True, help="phase_classifier.pt, per store"
    )
    return parser


if __name__ == "__main__":
    sys.exit(exit_status(main))
