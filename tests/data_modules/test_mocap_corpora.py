"""`data=mocap|trinity|genea|beat|zeggs`: stores from fake corpora in the published layouts."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from cospeech.errors import CospeechError
from cospeech.motion.joint_map import load_joint_map
from tests.fabricated.mocap import (
    TRINITY_BODY,
    put_bvh,
    put_text,
    swinging,
    write_beat,
    write_genea_2023,
    write_trinity_release,
    write_zeggs,
)

CONF = Path(__file__).resolve().parents[2] / "conf"


def data_module(name, root, stores, *overrides):
    """As ``python train.py data=NAME data.root=ROOT ...`` makes it."""
    settings = [
        "model=trimodal",
        f"data={name}",
        f"data.root='{root}'",
        f"data.store_dir='{stores}'",
        *(f"data.{override}" for override in ("batch_size=4", "workers=1", *overrides)),
    ]
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return instantiate(compose("train", overrides=settings).data)


def splits(store):
    """Recording ids by split."""
    return {
        split: sorted(store.recordings[span.recording].id for span in store.splits[split])
        for split in ("train", "val", "test")
    }


def test_trinity_released_and_challenge(tmp_path):
    root = write_trinity_release(tmp_path / "t", (1, 9, 16, 20), (3, 10), seconds=6.0)
    store = data_module("trinity", root, tmp_path / "s").prepare_store()
    found = {split: [n[15:] for n in names] for split, names in splits(store).items()}
    assert found == {"train": ["021", "027"], "val": ["001"], "test": ["004"]}
    assert {item["id"][15:]: item["kind"] for item in store.manifest["skipped"]} == {
        "021_2": "in no published split", "027_2": "in no published split",
    }  # fmt: skip
    rule = "split_rule=challenge"
    store = data_module("trinity", root, tmp_path / "s", rule).prepare_store()
    found = {split: [n[15:] for n in names] for split, names in splits(store).items()}
    assert found == {"train": ["004", "021_2", "027_2"], "val": ["001"], "test": ["021", "027"]}
    assert store.manifest["skipped"] == []


def test_genea(tmp_path):
    names = {"trn_2023_v0_000": (1, 2), "trn_2023_v0_001": (2, 1), "val_2023_v0_000": (1, 2)}
    root = write_genea_2023(tmp_path / "g", names | {"tst_2023_v0_000": (2, 1)}, seconds=6.0)
    store = data_module("genea", root, tmp_path / "s").prepare_store()
    assert splits(store) == {
        "train": ["trn_2023_v0_000", "trn_2023_v0_001"],
        "val": ["val_2023_v0_000"],
        "test": ["val_2023_v0_000"],
    }
    assert [item["kind"] for item in store.manifest["skipped"]] == ["no motion in the release"]


def test_beat_by_the_rule_and_by_a_list(tmp_path):
    names = ("2_scott_0_1_1", "2_scott_0_9_9", "2_scott_0_57_57")
    root = write_beat(tmp_path / "b", names, seconds=6.0, fps=30.0)
    store = data_module("beat", root, tmp_path / "s").prepare_store()
    assert splits(store) == {
        "train": ["2_scott_0_9_9"], "val": ["2_scott_0_57_57"], "test": ["2_scott_0_1_1"],
    }  # fmt: skip
    text = "id,type\n2_scott_0_1_1,train\n2_scott_0_9_9,val\n"
    path = put_text(tmp_path / "list.csv", text)
    store = data_module("beat", root, tmp_path / "s", f"split_list='{path}'").prepare_store()
    assert splits(store)["train"] == ["2_scott_0_1_1"]
    assert [item["id"] for item in store.manifest["skipped"]] == ["2_scott_0_57_57"]
    # another list is another corpus, even under the same name
    before = data_module("beat", root, tmp_path / "s", f"split_list='{path}'").store_parameters()
    path.write_text(text.replace("val", "test"))
    after = data_module("beat", root, tmp_path / "s", f"split_list='{path}'").store_parameters()
    assert before != after


def test_zeggs(tmp_path):
    names = {"001_Neutral_0": False, "005_Neutral_4": True}
    root = write_zeggs(tmp_path / "z", names, seconds=6.0, copies=("001_Neutral_0_x_0_9",))
    store = data_module("zeggs", root, tmp_path / "s").prepare_store()
    assert splits(store)["train"] == ["001_Neutral_0_x_1_0"]
    assert splits(store)["val"] == splits(store)["test"] == ["005_Neutral_4_x_1_0"]
    (root / "info.csv").unlink()
    with pytest.raises(CospeechError, match="none of the 3 recordings is in a published split"):
        data_module("zeggs", root, tmp_path / "s").prepare_store()
    sources = data_module("zeggs", root, tmp_path / "s", "split=recordings").find_sources()
    assert [type(next(iter(source.read()))).__name__ for source in sources] == [
        "Dropped", "Recording", "Recording",
    ]  # fmt: skip


def test_a_folders_name_is_made_fit_for_paths_and_shells(tmp_path):
    root = tmp_path / "na mé: x=1"
    assert data_module("mocap", root, tmp_path / "s").corpus_name == "mocap-na_mé__x_1"


def test_motion_without_audio(tmp_path):
    put_bvh(tmp_path / "m" / "a.bvh", swinging(TRINITY_BODY, "a", 20.0, 30))
    skipping = ("missing_audio=skip", "strict=true")
    with pytest.raises(CospeechError, match=r"no a\.wav.*for a\.bvh"):
        data_module("mocap", tmp_path / "m", tmp_path / "s", *skipping).prepare_store()
    store = data_module("mocap", tmp_path / "m", tmp_path / "s").prepare_store()
    assert store.annotations(0)["silent"] is True
    assert not store.audio(0, 0, 16_000).any()


def test_settings_that_change_a_recording_change_the_store(tmp_path):
    put_bvh(tmp_path / "m" / "a.bvh", swinging(TRINITY_BODY, "a", 2.0, 30))
    base = data_module("mocap", tmp_path / "m", tmp_path / "s")
    assert base.settings() == {
        "missing_audio": "auto", "frame_rate": None, "speaker": "folder", "licence": "",
    }  # fmt: skip
    told = ("phase_tier=phase", "phase_labels={p2: stroke}")
    settings = data_module("mocap", tmp_path / "m", tmp_path / "s", *told).settings()
    assert settings == base.settings() | {"phase_tier": "phase", "phase_labels": {"p2": "stroke"}}
    assert base.evaluation_joints() is None
    mapped = data_module("mocap", tmp_path / "m", tmp_path / "s", "joint_map=mixamo")
    assert mapped.evaluation_joints() == load_joint_map("mixamo")
    assert mapped.store_parameters() != base.store_parameters()


@pytest.mark.parametrize(
    ("folder", "count"),
    [("bandai_namco", 7), ("cmu", 1), ("trinity", 2), ("beat", 1), ("zeggs", 1)],
)
def test_every_real_folder_with_motion(shared, tmp_path, folder, count):
    root = shared / "data" / "real" / folder
    store = data_module("mocap", root, tmp_path).prepare_store()
    assert len(store.recordings) == count
    assert all(store.splits.values())
