"""Every published layout, from the files as they lie on disk to a trained and judged model."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests import command_line
from tests.bvh_elsewhere import read_elsewhere
from tests.fabricated.berkeley import write_2d, write_3d
from tests.fabricated.mocap import (
    TALK,
    TRINITY_BODY,
    write_beat,
    write_genea_2022,
    write_genea_2023,
    write_trinity_raw,
    write_trinity_release,
    write_zeggs,
)
from tests.fabricated.ted import write_ted
from tests.fabricated.uci import write_uci_video

pytestmark = pytest.mark.slow

TRIMODAL = ("model=trimodal", "model.hidden_size=16", "model.layers=1")
SMALL = (
    "training.batch_size=8",
    "training.epochs=1",
    "metrics.encoder_epochs=1",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "callbacks.render_samples.seconds=3",
    "logger=csv",
)


def train(outputs, root, data, *overrides, model=TRIMODAL):
    """Train and judge; the run's record."""
    settings = (*model, *SMALL, f"data={data}", f"data.root={root}", *overrides)
    done = command_line.run(outputs, *settings)
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(outputs).items()
    assert record["status"] == "ok"
    assert record["final"]["windows"]["fgd"] >= 0
    assert record["final"]["recordings"]["fgd"] >= 0
    assert {"real_train", "mean_pose", "noise"} <= set(record["references"])
    assert (folder / "samples" / "player.html").is_file()
    return record


def ted(root):
    return write_ted(root, videos=12, seconds_per_video=30)


def ted_cache(root):
    return write_ted(root, videos=12, seconds_per_video=30, cache=True)


def berkeley(root):
    write_3d(root, "oliver", {"train_noduplication": 12, "dev_noduplication": 3, "test": 2})
    return root


def trinity(root):
    return write_trinity_release(root, training=(2, 3, 16, 18, 19, 20), test=(3,), seconds=9.0)


def genea_2022(root):
    names = {"trn_2022_v1_000": 1, "trn_2022_v1_001": 2, "val_2022_v1_000": 1, "tst_2022_v1_000": 3}
    return write_genea_2022(root, names, seconds=9.0)


def genea_2023(root):
    names = {"trn_2023_v0_000": (1, 2), "trn_2023_v0_001": (2, 1), "val_2023_v0_000": (3, 4)}
    return write_genea_2023(root, names, seconds=9.0)


def beat(root):
    return write_beat(root, ("2_scott_0_17_17", "2_scott_0_57_57", "2_scott_0_1_1"), seconds=9.0)


def zeggs(root):
    names = {"001_Neutral_0": False, "005_Happy_4": True}
    return write_zeggs(root, names, seconds=9.0)


def uci(root):
    root.mkdir()
    for video in ("a1", "a2", "a3", "b1", "b3", "c1", "c3"):
        write_uci_video(root, video)


@pytest.mark.parametrize(
    ("data", "write"),
    [
        ("ted", ted),
        ("ted", ted_cache),
        ("berkeley", berkeley),
        ("trinity", trinity),
        ("genea", genea_2022),
        ("genea", genea_2023),
        ("beat", beat),
        ("zeggs", zeggs),
    ],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_a_published_layout_is_trained_on(data, write, tmp_path):
    write(tmp_path / "data")
    train(tmp_path, tmp_path / "data", data)


def trinity_raw(root):
    for number in (2, 4, 10, 11):
        write_trinity_raw(root, number, motion_lead=0.75, audio_lead=1.2345, seconds=9.0)
    rows = "".join(f"{number},1.2345,0.75\n" for number in (2, 4, 10, 11))
    (root / "AlignmentTimes.csv").write_text(f"Take,AudioStart,MotionStart\n{rows}")


@pytest.mark.parametrize("layout", ["released", "raw"])
def test_gesticulator_is_trained_on_trinity_and_writes_its_skeleton(layout, tmp_path):
    """As its paper: takes 1-2 validate, 3-5 test; words only where there are transcripts."""
    root, text = tmp_path / "data", ["model.text=none"]
    if layout == "released":
        trinity(root)
        rng = np.random.default_rng(0)
        lines = [f"{word} {' '.join(map(str, rng.standard_normal(4).round(3)))}" for word in TALK]
        vectors = tmp_path / "words.vec"
        vectors.write_text("\n".join([f"{len(lines)} 4", *lines]) + "\n")
        text = ["model.text=static", f"model.word_vectors={vectors}"]
    else:
        trinity_raw(root)
    model = ("model=gesticulator", "experiment=gesticulator_quick", *text)
    record = train(tmp_path, root, "trinity", "+trainer.limit_train_batches=2", model=model)
    (folder,) = command_line.records(tmp_path)
    overlap = "NaturalTalking_021: the released split trains on a test recording"
    assert (overlap in (folder / "train.log").read_text()) is (layout == "released")
    (manifest,) = tmp_path.glob("stores/*/manifest.json")
    recordings = json.loads(manifest.read_text())["recordings"]
    splits = dict(zip(recordings["id"], recordings["split"], strict=True))
    assert {name[-3:]: split for name, split in splits.items()} == (
        {"001": "val", "002": "val", "004": "test", "005": "test"}
        | {"021": "train", "023": "train", "030": "train"}
        if layout == "released"
        else {"002": "val", "004": "test", "010": "train", "011": "train"}
    )
    assert record["epochs"][-1]["train/pose"] > 0
    sound = next(root.rglob("*.wav"))
    made = command_line.run(
        tmp_path, f"run={folder}", f"audio={sound}", "checkpoint=last", script="generate.py"
    )
    assert made.returncode == 0, made.stderr
    theirs = read_elsewhere(Path(re.search(r"for a rig: (\S+)", made.stdout)[1]))
    assert sorted(theirs.names) == sorted(TRINITY_BODY.joints)
    assert theirs.frame_s == pytest.approx(1 / 20)
    seconds = soundfile.info(sound).duration
    assert len(theirs.positions_world) == math.ceil(seconds * 20 - 1e-6)


def test_the_genuine_ted_databases_are_trained_on(shared, tmp_path):
    record = train(tmp_path, shared / "data" / "ted_legacy_fixture", "ted")
    assert len(record["config"]["data"]["root"]) > 0


@pytest.mark.parametrize("folder", ["bandai_namco", "beat", "cmu", "trinity", "zeggs"])
def test_every_folder_of_real_motion_is_trained_on(folder, shared, tmp_path):
    train(tmp_path, shared / "data" / "real" / folder, "mocap")


@pytest.mark.parametrize(
    ("data", "write", "why"),
    [
        ("berkeley", lambda root: write_2d(root, frames=80, intervals=3), "2-D keypoints"),
        ("uci_phases", uci, "a skeleton without arms"),
    ],
    ids=["berkeley", "uci_phases"],
)
def test_the_impossible_is_refused_before_anything_is_prepared(data, write, why, tmp_path):
    write(tmp_path / "data")
    settings = (*TRIMODAL, *SMALL, f"data={data}", f"data.root={tmp_path / 'data'}")
    done = command_line.run(tmp_path, *settings)
    assert done.returncode == 1
    assert "trimodal needs 3-D positions of the upper body" in done.stderr
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "stores").exists()
