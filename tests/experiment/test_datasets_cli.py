"""Every published layout, from the files as they lie on disk to a trained and judged model."""

import pytest

from tests import command_line
from tests.fabricated.berkeley import write_2d, write_3d
from tests.fabricated.mocap import (
    write_beat,
    write_genea_2022,
    write_genea_2023,
    write_trinity_release,
    write_zeggs,
)
from tests.fabricated.ted import write_ted
from tests.fabricated.uci import write_uci_video

pytestmark = pytest.mark.slow

SMALL = (
    "model=trimodal",
    "model.hidden_size=16",
    "model.layers=1",
    "training.batch_size=8",
    "training.epochs=1",
    "metrics.encoder_epochs=1",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "callbacks.render_samples.seconds=3",
    "logger=csv",
)


def train(outputs, root, data, *overrides):
    """Train and judge; the run's record."""
    done = command_line.run(outputs, *SMALL, f"data={data}", f"data.root={root}", *overrides)
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
    done = command_line.run(tmp_path, *SMALL, f"data={data}", f"data.root={tmp_path / 'data'}")
    assert done.returncode == 1
    assert "trimodal needs 3-D positions of the upper body" in done.stderr
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "stores").exists()
