"""What methods on a matching database share: which database, whose motion, what is judged."""

import shutil

import numpy as np
import pytest
import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.window_loader import open_windows
from cospeech.errors import CospeechError
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import database_folder, fit_database
from cospeech.methods.motion_matching import MotionMatching, RefinedMotionMatching
from cospeech.metrics.movement import border_steps
from tests.corpora import make_recording, make_store
from tests.multi_adversary_runs import embedded_store


@pytest.fixture
def store(tmp_path):
    takes = [make_recording(f"t{i}", ("ada", "ben")[i % 2], 12, seed=i) for i in range(6)]
    return make_store(tmp_path, takes)


def fitted(store, **settings):
    method = MotionMatching(store.facts(), chunk_frames=32, **settings)
    method.on_fit_start()
    return method


def stages(method, store, speaker=None, seed=0):
    generator = torch.Generator().manual_seed(seed)
    speech = store.speech(Span(5, 0, 90))
    return method.matcher(speech, None, generator, method.closed_sequences(speaker, generator))


def test_one_speaker_at_a_time(store):
    method = fitted(store)
    database = method.database
    for name in ("ada", "ben"):
        assert database.spoken_by(name)[stages(method, store, name).matched.sequences].all()
    drawn = {
        bool(database.spoken_by("ada")[stages(method, store, None, seed).matched.sequences].all())
        for seed in range(8)
    }
    assert drawn == {True, False}
    used = stages(fitted(store, same_speaker=False), store, "ada").matched.sequences
    assert not database.spoken_by("ada")[used].all()


def test_a_checkpoint_knows_its_database(store, tmp_path):
    method = fitted(store)
    state = method.state_dict()
    assert bytes(state["database_hash"].tolist()).hex() == method.database.hash
    same = MotionMatching(store.facts(), chunk_frames=32)
    same.load_state_dict(state)
    assert same.database.hash == method.database.hash
    other = MotionMatching(store.facts(), chunk_frames=16)
    other.load_state_dict(state)
    with pytest.raises(CospeechError, match="made with matching database") as caught:
        other.matcher  # noqa: B018
    assert method.database.hash[:12] in str(caught.value)
    folder = tmp_path / "elsewhere"
    shutil.copytree(database_folder(store, method.spec), folder)
    moved = MotionMatching(store.facts(), chunk_frames=16, database=str(folder))
    moved.load_state_dict(state)
    assert moved.database.hash == method.database.hash


def test_a_corpus_that_is_gone_or_another_one_is_named(store):
    facts = store.facts()
    with pytest.raises(CospeechError, match="holds another corpus"):
        MotionMatching({**facts, "fingerprint": "f" * 64}).database  # noqa: B018
    with pytest.raises(CospeechError, match="the prepared corpus is gone") as caught:
        MotionMatching({**facts, "store": "nowhere"}).database  # noqa: B018
    assert "database=DIR" in str(caught.value)


def test_generated_motion_is_that_of_the_last_stage(store):
    method = fitted(store)
    speech = store.speech(Span(5, 0, 90))
    motion = method.generate(speech, "ada", generator=torch.Generator().manual_seed(3))
    poses = method.stages(speech, None, torch.Generator().manual_seed(3), "ada")["k-NN"]
    np.testing.assert_array_equal(motion.positions, method.database.upper_body(poses))


def test_controls_reach_the_search(store):
    method = fitted(store, same_speaker=False)
    speech = store.speech(Span(5, 0, 170))
    wrist = method.database.pose_roles.index("left_wrist")
    heights = []
    for where in ("left_wrist_height >= p60", "left_wrist_height <= p40"):
        controls = {"controls": [{"where": where}], "when_empty": "error"}
        motion = method.generate(speech, controls=controls)
        heights.append(motion.positions[:, 6, 1].mean())
    spread = method.database.poses[:, :, wrist, 1].std()
    assert heights[0] - heights[1] > spread


def test_the_seam_is_that_of_the_samples(store):
    method = fitted(store)
    windows = open_windows(store, "val", method)
    batch = windows.batch(range(len(windows)))
    method.on_validation_epoch_start()
    method.validation_step(batch, 0)
    poses = method._sample_poses(batch, torch.Generator().manual_seed(0)).numpy()
    at_border, inside = zip(*(border_steps(window, 8) for window in poses), strict=True)
    expected = np.median(np.concatenate(at_border)) / np.median(np.concatenate(inside))
    assert method.seam() == pytest.approx(expected)


def test_a_store_that_was_moved_is_named(store, tmp_path):
    method = MotionMatching(store.facts(), chunk_frames=32)
    (tmp_path / "moved").mkdir()
    facts = store.facts()
    shutil.move(store.path, tmp_path / "moved" / store.path.name)
    with pytest.raises(CospeechError, match=r"is gone.*\n?.*database=DIR for generate.py"):
        method.database  # noqa: B018
    moved = {**facts, "store": str(tmp_path / "moved" / store.path.name)}
    assert len(MotionMatching(moved, chunk_frames=32).database) > 0


def test_a_database_of_another_skeleton_is_refused_before_any_sound(store, tmp_path):
    """The network's corpus has no fingers, the database's has."""
    fingers = embedded_store(tmp_path / "fingers")
    fit_database(fingers, MatchingSpec())
    folder = str(database_folder(fingers, MatchingSpec()))
    method = RefinedMotionMatching(
        store.facts(), generator_width=4, critic_width=8, database=folder
    )
    with pytest.raises(CospeechError, match="other joints than the network: left_index_tip"):
        method.open()
