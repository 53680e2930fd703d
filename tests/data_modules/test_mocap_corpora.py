"""`data=mocap|trinity|genea|beat|zeggs`: stores from fake corpora in the published layouts."""

import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from cospeech.corpus.store import Store
from cospeech.doctor import Check, check_path
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.bvh import write_bvh
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.joint_map import find_joint_map, load_joint_map
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import to_upper_body
from cospeech.motion.velocities import wrists
from tests.fabricated.mocap import (
    TRINITY_BODY,
    bursts,
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


def test_a_corpus_without_transcripts_says_so_before_a_file_is_read(tmp_path):
    """Padding words stand for none (the field words); vectors of words would all be silence."""
    silent = data_module("zeggs", write_zeggs(tmp_path / "z", {"001_Neutral_0": True}), tmp_path)
    with pytest.raises(ConfigError, match=r"needs transcripts .*, and zeggs has none") as caught:
        silent.refuse_impossible("gesticulator", frozenset({"rotations", "spoken_words"}))
    assert "model.text=none" in caught.value.hint
    silent.refuse_impossible("gesticulator", frozenset({"rotations", "mel_gesticulator"}))
    silent.refuse_impossible("trimodal", frozenset({"positions", "words"}))
    spoken = data_module("beat", write_beat(tmp_path / "b", ("2_scott_0_1_1",)), tmp_path)
    spoken.refuse_impossible("gesticulator", frozenset({"spoken_words"}))


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


def test_speakers_of_every_alphabet_and_names_that_are_no_utf_8(tmp_path, request):
    # What is logged goes to pytest's reports, which can't be sent with such names in them.
    logging.disable()
    request.addfinalizer(lambda: logging.disable(logging.NOTSET))
    for path in ("Jörg/a.bvh", "Jörg/b.bvh", "J\udcf6rg/n\udcfc.bvh"):
        put_bvh(tmp_path / "m" / path, swinging(TRINITY_BODY, path[0], 3.0, 10))
        soundfile.write(tmp_path / "made.ogg", bursts("n", 3.0), 16_000)
        (tmp_path / "made.ogg").rename((tmp_path / "m" / path).with_suffix(".ogg"))
    mine = ("split=recordings", r"speaker='^(\w+)'")
    store = data_module("mocap", tmp_path / "m", tmp_path / "s", *mine).prepare_store()
    assert [one.speaker for one in store.recordings] == ["Jörg", "Jörg", "J"]
    assert store.audio(2, 0, 48_000).any()
    findings = check_path(tmp_path / "m").findings
    assert not [found for found in findings if found.check is Check.UNREADABLE]


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
        "missing_audio": "auto", "frame_rate": None, "unit_scale": None, "up_axis": "y",
        "phase_tier": None, "phase_labels": {}, "speaker": "folder", "licence": "",
        "joint_map": "None",
    }  # fmt: skip
    told = ("phase_tier=phase", "phase_labels={p2: stroke}")
    settings = data_module("mocap", tmp_path / "m", tmp_path / "s", *told).settings()
    assert settings == base.settings() | {"phase_tier": "phase", "phase_labels": {"p2": "stroke"}}
    assert base.evaluation_joints() is None
    mapped = data_module("mocap", tmp_path / "m", tmp_path / "s", "joint_map=mixamo")
    assert mapped.evaluation_joints() == load_joint_map("mixamo")
    assert mapped.store_parameters() != base.store_parameters()
    for change in ("unit_scale=1", "up_axis=z", "frame_rate=15"):
        changed = data_module("mocap", tmp_path / "m", tmp_path / "s", change)
        assert changed.store_parameters() != base.store_parameters()


@pytest.mark.parametrize(
    ("setting", "match"),
    [
        ("frame_rate=0", r"data\.frame_rate=0: frames per second, a number from 0\.1 to 1000"),
        ("frame_rate=fast", r"data\.frame_rate=fast"),
        ("frame_rate=true", r"data\.frame_rate=True"),
        ("unit_scale=-1", r"data\.unit_scale=-1: metres per unit"),
        ("unit_scale=cm", r"data\.unit_scale=cm"),
        ("unit_scale=nan", r"data\.unit_scale=nan"),
        ("up_axis=x", r"data\.up_axis=x: choose one of y, z"),
        ("phase_labels=stroke", r"data\.phase_labels=stroke: what each label means"),
        ("up_axis=null", r"data\.up_axis=None: choose one of y, z"),
    ],
)
def test_what_no_file_can_be_read_with_is_refused(setting, match, tmp_path):
    with pytest.raises(Exception, match=match) as caught:
        data_module("mocap", tmp_path, tmp_path / "s", setting)
    assert isinstance(caught.value.__cause__ or caught.value, ConfigError)


@pytest.mark.parametrize("corpus", ["mocap", "beat", "genea", "trinity", "zeggs"])
def test_every_corpus_of_bvh_files_has_the_settings(corpus, tmp_path):
    settings = data_module(corpus, tmp_path, tmp_path / "s", "unit_scale=0.0254", "up_axis=z")
    assert settings.settings() | {"unit_scale": 0.0254, "up_axis": "z"} == settings.settings()


def wrist_heights(store):
    motion = store.motion(0)
    return motion.positions[:, motion.skeleton.index["LeftHand"], 1]


def test_units_and_vertical_are_settings(tmp_path):
    take = swinging(TRINITY_BODY, "a", 10.0, 30)
    put_bvh(tmp_path / "cm" / "a.bvh", take)
    write_bvh(put_text(tmp_path / "m" / "a.bvh", ""), take, unit_scale=1.0)
    expected = data_module("mocap", tmp_path / "cm", tmp_path / "s").prepare_store()
    scaled = data_module("mocap", tmp_path / "m", tmp_path / "s", "unit_scale=1").prepare_store()
    np.testing.assert_allclose(wrist_heights(scaled), wrist_heights(expected), atol=1e-4)
    # what is y up and read as z up lies on its face
    with pytest.raises(CospeechError, match="the head is towards -z of the spine"):
        data_module("mocap", tmp_path / "cm", tmp_path / "s", "up_axis=z").prepare_store()


def test_the_map_of_the_user_is_kept_with_the_corpus(tmp_path):
    """On a skeleton that no packaged map fits; whatever asks later needs no file."""
    body = replace(TRINITY_BODY, joints=tuple(f"{name}Bone" for name in TRINITY_BODY.joints))
    take = replace(swinging(TRINITY_BODY, "a", 10.0, 30), skeleton=body)
    put_bvh(tmp_path / "m" / "a.bvh", take)
    with pytest.raises(CospeechError, match="no joint map fits"):
        data_module("mocap", tmp_path / "m", tmp_path / "s").prepare_store()
    lines = {
        "spine": "Spine1", "neck": "Neck", "nose": "Head", "head": "Head",
        "left_shoulder": "LeftArm", "left_elbow": "LeftForeArm", "left_wrist": "LeftHand",
        "right_shoulder": "RightArm", "right_elbow": "RightForeArm", "right_wrist": "RightHand",
    }  # fmt: skip
    text = "joints:\n" + "".join(f"  {role}: {joint}Bone\n" for role, joint in lines.items())
    path = put_text(
        tmp_path / "mine.yaml", text + "hips: {right: RightUpLegBone, left: LeftUpLegBone}"
    )
    given = f"joint_map='{path}'"
    store = data_module("mocap", tmp_path / "m", tmp_path / "s", given).prepare_store()
    chosen = load_joint_map(path)
    path.unlink()
    store = Store(store.path)
    assert store.skeletons[0].joint_map == chosen
    facts = json.loads(json.dumps(store.facts()))
    layout = gesture_joints(Skeleton.from_dict(facts["skeleton"]))
    assert layout.body.joints[:3] == ("LeftArmBone", "LeftForeArmBone", "LeftHandBone")
    assert wrists(store.skeletons[0]).joints == ("LeftHandBone", "RightHandBone")
    upper = to_upper_body(store.motion(0)).positions
    np.testing.assert_allclose(store.upper_body(0)[0], upper[0], atol=1e-5)


def test_the_packaged_map_that_was_found_is_kept_with_the_corpus(tmp_path):
    put_bvh(tmp_path / "m" / "a.bvh", swinging(TRINITY_BODY, "a", 10.0, 30))
    store = data_module("mocap", tmp_path / "m", tmp_path / "s").prepare_store()
    found = find_joint_map(TRINITY_BODY)
    assert store.manifest["skeletons"][0]["joint_map"] == found.to_dict()


WILD = Path(__file__).resolve().parents[1] / "data" / "wild" / "own_joint_map"


@pytest.mark.parametrize("given", [(), (f"joint_map='{WILD / 'classic.yaml'}'",)])
def test_recordings_with_classic_names(given, tmp_path):
    """Without a map, by the packaged one; the user's own goes before it."""
    store = data_module("mocap", WILD, tmp_path, "split=recordings", *given).prepare_store()
    assert len(store.recordings) == 4
    (skeleton,) = store.skeletons
    assert skeleton.joint_map.name == ("classic" if given else "classic_chests")
    names = [recording.id for recording in store.recordings]
    motion = store.motion(names.index("take0"))
    expected = json.loads((WILD / "expected_positions.json").read_text())["frames"]
    for frame, joints in expected.items():
        for joint, place in joints.items():
            found = motion.positions[int(frame), skeleton.index[joint]]
            np.testing.assert_allclose(found, place, atol=1e-4)


def test_a_header_that_is_a_row_off_costs_nothing(tmp_path):
    put_bvh(tmp_path / "m" / "a.bvh", swinging(TRINITY_BODY, "a", 10.0, 30))
    text = (tmp_path / "m" / "a.bvh").read_text()
    put_text(tmp_path / "m" / "b.bvh", text.replace("Frames: 300", "Frames: 299"))
    put_text(tmp_path / "m" / "c.bvh", text.replace("Frames: 300", "Frames: 0"))
    store = data_module("mocap", tmp_path / "m", tmp_path / "s").prepare_store()
    assert [(one.id, one.fps) for one in store.recordings] == [("a", 30.0), ("b", 30.0)]
    warnings = [store.annotations(i).get("warnings", []) for i in range(2)]
    assert [len([w for w in told if "frames, 300 rows follow" in w]) for told in warnings] == [0, 1]
    (skipped,) = store.manifest["skipped"]
    assert "the header says 0 frames at 30 fps" in skipped["reason"]


@pytest.mark.parametrize(
    ("folder", "count"),
    [("bandai_namco", 7), ("cmu", 1), ("trinity", 2), ("beat", 1), ("zeggs", 1)],
)
def test_every_real_folder_with_motion(shared, tmp_path, folder, count):
    root = shared / "data" / "real" / folder
    store = data_module("mocap", root, tmp_path).prepare_store()
    assert len(store.recordings) == count
    assert all(store.splits.values())
