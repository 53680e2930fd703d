"""A skeleton that only the user's own joint map knows: every method trains on it and speaks."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from cospeech.formats.phase_files.writing import write_phase_table
from cospeech.judges.phase_classifier.__main__ import main as phase_classifier
from cospeech.motion.phases import PhaseSegment
from tests import command_line

pytestmark = pytest.mark.slow

WILD = Path(__file__).resolve().parents[1] / "data" / "wild" / "own_joint_map"
SMALL = (
    "debug=fast",
    "data=mocap",
    "data.split=recordings",
    "callbacks.render_samples.video=false",
    "logger=none",
)
METHODS = {
    "knn": (),
    "knn_cgan": (
        "model.generator_width=8",
        "model.critic_width=8",
        "model.critic_updates=4",
        "model.pair_stride=32",
    ),
    # The takes are shorter than two windows in a row.
    "multi_adversary": ("experiment=multi_adversary_quick", "model.hidden_size=16", "model.run=1"),
    "phase_classifier": ("model.dense=8", "model.recurrent=8", "model.bidirectional=8"),
    "trimodal": ("model.hidden_size=16", "model.layers=1"),
}


def unknown(text):
    """The same with joint names that no packaged map has."""
    joints = r"\b((?:Left|Right)(?!_)\w+|Chest\d?|Neck|Head|Hips)\b"
    return re.sub(joints, lambda match: f"{match[1]}Bone", text)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    labels = ("rest_hold", "preparation", "stroke", "retract")
    for path in WILD.iterdir():
        if path.suffix not in (".bvh", ".yaml"):
            shutil.copy(path, folder)
            continue
        (folder / path.name).write_text(unknown(path.read_text()))
        if path.suffix == ".bvh":
            segments = [
                PhaseSegment(0.7 * i, 0.7 * (i + 1), labels[i % len(labels)]) for i in range(19)
            ]
            write_phase_table(folder / f"{path.stem}.phases.csv", segments)
    assert "ROOT HipsBone" in (folder / "take0.bvh").read_text()
    return folder


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """One outputs folder: the store and the encoder are made once."""
    return tmp_path_factory.mktemp("outputs")


def trained(method, corpus, outputs):
    """The run folder of a method that was trained on the corpus."""
    map_of_the_user = (f"data.root={corpus}", f"data.joint_map={corpus / 'classic.yaml'}")
    before = command_line.records(outputs).keys()
    done = command_line.run(
        outputs, f"model={method}", *SMALL, *METHODS[method], *map_of_the_user, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    records = command_line.records(outputs)
    (folder,) = records.keys() - before
    assert records[folder]["status"] == "ok"
    return folder


def test_without_the_map_the_error_says_what_to_write(corpus, outputs):
    given = ("data=mocap", f"data.root={corpus}", "data.strict=true")
    done = command_line.run(outputs, *given, script="prepare.py")
    assert done.returncode == 1
    assert "data.joint_map=my_corpus.yaml" in done.stderr


@pytest.mark.parametrize("method", [name for name in METHODS if name != "phase_classifier"])
def test_a_method_trains_and_speaks(method, corpus, outputs):
    folder = trained(method, corpus, outputs)
    audio = f"audio={WILD / 'take0.ogg'}"
    # two batches are not a stage; what is looked at here is that it speaks at all
    done = command_line.run(
        outputs, f"run={folder}", audio, "checkpoint=last", script="generate.py", timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    with np.load(re.search(r"motion: (\S+)", done.stdout)[1]) as arrays:
        assert np.isfinite(arrays["positions"]).all()


def test_the_classifier_trains_and_labels(corpus, outputs, tmp_path, capsys):
    folder = trained("phase_classifier", corpus, outputs)
    (weights,) = folder.rglob("phase_classifier.pt")
    files = [str(corpus / "take0.bvh"), "--classifier", str(weights), "--out", str(tmp_path)]
    files += ["--audio", str(corpus / "take0.ogg")]
    assert phase_classifier(["label", *files]) == 1
    assert "no joint map fits" in capsys.readouterr().err
    assert phase_classifier(["label", *files, "--joint-map", str(corpus / "classic.yaml")]) == 0
    assert (tmp_path / "take0.phases.csv").read_text().startswith("start_s,end_s,phase,class")
