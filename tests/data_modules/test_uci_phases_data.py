"""`data=uci_phases`: the protocols, and a recurrent classifier on gestures of real people."""

import pytest

from data_modules.uci_phases import UciPhasesData
from tests import command_line
from tests.fabricated.uci import write_uci_video


def uci_data(root, store_dir, **changed):
    settings = {
        "protocol": "leave_user_out",
        "held_out": "c",
        "split": "published",
        "batch_size": 32,
        "seed": 0,
        "val_share": 0.1,
        "test_share": 0.1,
        "split_seed": 0,
        "strict": True,
        "max_recordings": None,
        "workers": 1,
    }
    return UciPhasesData(root=str(root), store_dir=str(store_dir), **{**settings, **changed})


def test_the_protocols(tmp_path):
    folder = tmp_path / "raw"
    folder.mkdir()
    for i, video in enumerate(("a1", "a2", "b1", "c1")):
        write_uci_video(folder, video, rows=300, seed=i)
    store = uci_data(folder, tmp_path / "stores").prepare_store()
    videos = {
        split: [store.recordings[span.recording].id for span in spans]
        for split, spans in store.splits.items()
    }
    assert videos == {"train": ["a1", "b1"], "val": ["a2"], "test": ["c1"]}
    assert all(store.recordings.columns["has_phases"])
    assert store.annotations(0)["story"] == 1
    changed = {"protocol": "leave_video_out", "held_out": "a1"}
    other = uci_data(folder, tmp_path / "stores", **changed).prepare_store()
    assert [other.recordings[span.recording].id for span in other.splits["test"]] == ["a1"]


@pytest.mark.slow
@pytest.mark.parametrize(("classes", "tree_baseline"), [("five", 0.56), ("four", 0.64)])
def test_a_recurrent_classifier_knows_the_phases_of_a_user_it_never_saw(
    shared, tmp_path, classes, tree_baseline
):
    """User c is left out; the epoch is chosen on a video of a training user.

    The tree baseline is the weighted F of docs/facts/uci_gesture_phases.md, section 4 (velocities,
    mean over three left-out users).
    """
    done = command_line.run(
        tmp_path,
        "model=phase_classifier",
        f"model.classes={classes}",
        "model.joints=wrists",
        "model.pitch=false",
        "model.mirror=true",
        "model.smooth=true",
        "model.size_jitter=0.4",
        "model.dense=64",
        "model.recurrent=64",
        "model.bidirectional=32",
        "data=uci_phases",
        f"data.root={shared / 'data' / 'real' / 'uci_gesture_phase'}",
        "data.held_out=c",
        "training.epochs=20",
        "training.batch_size=32",
        "logger=none",
        timeout=900,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((_, record),) = command_line.records(tmp_path).items()
    found = record["final"]["windows"]
    assert found["accuracy"] > found["majority_accuracy"] + 0.2
    assert found["weighted_f"] > found["majority_weighted_f"] + 0.3
    assert found["weighted_f"] > tree_baseline - 0.05
