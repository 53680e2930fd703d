"""The evaluation space, a system's row and the reference rows."""

import json
import logging

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError
from cospeech.evaluation import references, standard_catalogue
from cospeech.metrics.encoder import GestureEncoder, PoseAutoencoder, load_any
from cospeech.metrics.evaluation_windows import EvaluationWindows, to_evaluation_windows
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.noise_study import LEVELS, run_noise_study
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY, to_upper_body
from tests.fabricated.mocap import TRINITY_BODY, swinging

METRICS = standard_catalogue()
BONES = [0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33]


def ramp(frames, fps):
    """Joint j's x is the time in seconds plus j."""
    positions = np.zeros((frames, 10, 3), dtype=np.float32)
    positions[..., 0] = np.arange(frames)[:, None] / fps + np.arange(10)
    return Motion(UPPER_BODY, fps, positions)


@pytest.mark.parametrize("fps", [15.0, 20.0, 30.0, 120.0])
def test_windows_lie_on_the_grid_at_any_rate(fps):
    # 5.2 s hold 78 frames at 15 fps; starts 0, 10, 20, 30, 40 leave room for 34 frames.
    windows = to_evaluation_windows(ramp(round(5.2 * fps), fps))
    assert windows.shape == (5, 34, 10, 3)
    times = (10 * torch.arange(5)[:, None] + torch.arange(34)) / 15
    torch.testing.assert_close(windows[:, :, 3, 0], times + 3, atol=1e-5, rtol=0)


@pytest.mark.parametrize(("frames", "count"), [(33, 0), (34, 1), (43, 1), (44, 2)])
def test_only_full_windows_count(frames, count):
    assert len(to_evaluation_windows(ramp(frames, 15.0))) == count


def test_other_skeletons_are_refused():
    arm = Skeleton("arm", ("shoulder", "elbow"), (-1, 0))
    motion = Motion(arm, 15.0, np.zeros((40, 2, 3), dtype=np.float32))
    with pytest.raises(CospeechError, match="no joint map fits the skeleton 'arm'"):
        to_evaluation_windows(motion)


def test_a_whole_skeleton_is_judged_by_the_ten_joints_that_it_has():
    motion = swinging(TRINITY_BODY, "a", 4.0, 20.0)
    windows = to_evaluation_windows(motion)
    torch.testing.assert_close(windows, to_evaluation_windows(to_upper_body(motion)))
    assert windows.shape == (3, 34, 10, 3)
    left_wrist = windows[0, 0, UPPER_BODY.index["left_wrist"]]
    index = TRINITY_BODY.index
    expected = motion.positions[0, index["LeftHand"]] - motion.positions[0, index["Spine1"]]
    np.testing.assert_allclose(left_wrist, expected, atol=1e-6)


@pytest.mark.parametrize("sizes", [(5, 5, 5), (1, 9, 10), (3, 1, 4, 1, 5, 9, 2, 6), (4, 4)])
def test_mismatch_moves_every_window_to_another_recording(sizes):
    ids = [recording for recording, size in enumerate(sizes) for _ in range(size)]
    for seed in range(5):
        other = references._other_recording(ids, torch.Generator().manual_seed(seed))
        assert sorted(other.tolist()) == list(range(len(ids)))
        assert all(ids[i] != ids[j] for i, j in enumerate(other.tolist()))


def test_mismatch_within_the_only_recording_still_moves_every_window():
    other = references._other_recording(["a"] * 7, torch.Generator().manual_seed(0))
    assert sorted(other.tolist()) == list(range(7))
    assert all(i != j for i, j in enumerate(other.tolist()))


def test_halves_share_no_recording_and_are_about_equal():
    ids = [recording for recording in range(12) for _ in range(5 + recording % 3)]
    mask = references._halves(ids, torch.Generator().manual_seed(0))
    assert mask is not None
    sides = [{ids[i] for i in side.nonzero().flatten().tolist()} for side in (mask, ~mask)]
    assert not sides[0] & sides[1]
    assert abs(mask.float().mean().item() - 0.5) < 0.06
    assert references._halves(["a"] * 9, torch.Generator().manual_seed(0)) is None


def ted_culture(folder):
    """Windows of real speakers and of a published model, and the recording of each.

    The set looks along -z with y down and has no head top; the published mean direction stands in
    for that bone. Each frame is turned to face forward.
    """
    codec = DirectionVectorCodec([0.0] * 27, BONES)
    real: list[torch.Tensor] = []
    model: list[torch.Tensor] = []
    ids: list[str] = []
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as clip:
            for name, into in (("human_dir_vec", real), ("model_out_dir_vec", model)):
                frames = min(len(clip["human_dir_vec"]), len(clip["model_out_dir_vec"]))
                vectors = torch.from_numpy(clip[name][:frames]).float().view(-1, 42, 3)
                vectors = vectors * torch.tensor([1.0, -1.0, -1.0])
                across = vectors[:, 1] - vectors[:, 2]
                yaw = torch.atan2(across[:, 2], across[:, 0])[:, None]
                x, y, z = vectors.unbind(-1)
                turned = (x * yaw.cos() + z * yaw.sin(), y, z * yaw.cos() - x * yaw.sin())
                vectors = torch.stack(turned, -1)
                head = torch.tensor([0.0035, 0.8755, -0.4121]).expand(frames, 3)
                bones = [vectors[:, k] for k in (0, 37, 1, 3, 4, 2, 20, 21)]
                bones.insert(2, head)
                positions = codec.decode(torch.stack(bones, 1).flatten(1), unit_length=True)
                windows = to_evaluation_windows(Motion(UPPER_BODY, 15.0, positions.numpy()))
                into.append(windows)
        ids += [path.stem] * len(windows)
    return torch.cat(real), torch.cat(model), ids


@pytest.fixture(scope="module")
def people(shared):
    return ted_culture(shared / "data/real/ted_culture")


@pytest.fixture(scope="module")
def published(shared):
    return load_any(shared / "data/real/checkpoints/trimodal_h36m_gesture_autoencoder_34f.bin")


def test_published_encoder_knows_real_people_in_our_axes_only(published, people):
    """Reconstruction halves the distance from the mean pose; no mirrored pose comes close."""
    positions = people[0]

    def error(signs):
        features = published.to_features(positions * torch.tensor(signs))
        return (published.network(features) - features).abs().mean().item()

    ours = error((1.0, 1.0, 1.0))
    assert ours < 0.6 * published.to_features(positions).abs().mean().item()
    for signs in ((-1.0, 1, 1), (1.0, -1, 1), (1.0, 1, -1), (-1.0, -1, 1), (-1.0, 1, -1)):
        assert error(signs) > 3 * ours


def encoded(encoder, positions):
    return EvaluationWindows(positions, encoder.encode_all(positions))


def test_rows_of_real_people(published, people):
    real, model, ids = people
    train = [encoded(published, batch) for batch in real.split(50)]
    real, model = encoded(published, real), encoded(published, model)
    rows = references.rows_of(published, train, real, ids, 0, METRICS)
    rows["model"] = METRICS.row(model, real, recording_ids=ids)
    assert json.loads(json.dumps(rows)) == rows

    assert rows["real_train"]["fgd"] == pytest.approx(0, abs=1e-9)
    assert rows["real_halves"]["windows"] + rows["real_halves"]["windows_real"] == len(real)
    # A published model moves more like people than a motionless or a dislocated body does, and
    # its motion is nearer to this speaker's than another speaker's motion is.
    assert rows["model"]["fgd"] < rows["noise"]["fgd"] < rows["mean_pose"]["fgd"]
    assert rows["attenuated"]["fgd"] < rows["model"]["fgd"]
    assert rows["model"]["joint_mae"] < rows["mismatched"]["joint_mae"]
    # Damping by 0.8 errs by a fifth of what standing still does: both deviate from one mean pose.
    assert rows["attenuated"]["joint_mae"] == pytest.approx(
        0.2 * rows["mean_pose"]["joint_mae"], rel=1e-4
    )
    # The noise of a window is the same on all its frames, so it has no acceleration.
    assert rows["noise"]["acceleration_error"] == pytest.approx(0, abs=1e-7)
    for row in (rows["model"], rows["mean_pose"]):
        assert row["fgd_low"] <= row["fgd_high"]
        assert row["recordings"] == 10
        assert row["fgd"] == pytest.approx(row["fgd_mean_term"] + row["fgd_covariance_term"])


def test_row_agrees_with_the_streaming_metric(published, people):
    real, model, ids = people
    metric = FrechetGestureDistance()
    for a, b in zip(model.split(32), real.split(32), strict=True):
        metric.update(encoded(published, a), encoded(published, b))
    row = METRICS.row(encoded(published, model), encoded(published, real), recording_ids=ids)
    assert metric.compute()["value"].item() == pytest.approx(row["fgd"], rel=1e-5)


def test_one_recording_gives_the_rows_that_it_can(caplog):
    encoder = GestureEncoder(PoseAutoencoder(), [0.0] * 27)
    positions = torch.randn(40, 34, 10, 3, generator=torch.Generator().manual_seed(0))
    real = encoded(encoder, positions)
    with caplog.at_level(logging.WARNING):
        rows = references.rows_of(encoder, [real], real, ["only"] * 40, 0, METRICS)
    assert "real_halves" not in rows
    assert "fgd_low" not in rows["noise"]
    assert "no real-versus-real floor" in caplog.text
    with pytest.raises(CospeechError, match="0 windows to be compared with 40 real ones"):
        references.rows_of(encoder, [], real, ["only"] * 40, 0, METRICS)


def test_the_mean_pose_and_what_is_damped_towards_it_are_the_training_s():
    encoder = GestureEncoder(PoseAutoencoder(), [0.0] * 27)
    generator = torch.Generator().manual_seed(0)
    train = 3 + torch.randn(30, 34, 10, 3, generator=generator)
    train[:20] += 6
    real = torch.randn(24, 34, 10, 3, generator=generator)
    batches = [encoded(encoder, batch) for batch in train.split((20, 5, 5))]
    ids = [i // 4 for i in range(24)]
    rows = references.rows_of(encoder, batches, encoded(encoder, real), ids, 0, METRICS)
    pose = train.double().mean((0, 1))
    from_pose = (real.double() - pose)[:, 4:].abs().mean().item()
    assert rows["mean_pose"]["joint_mae"] == pytest.approx(from_pose, rel=1e-5)
    assert rows["attenuated"]["joint_mae"] == pytest.approx(0.2 * from_pose, rel=1e-5)
    # The rows of recorded motion say how strongly that is moved, whatever speech it stands beside.
    for name, order in (("acceleration", 2), ("jerk", 3)):
        sides = {"real_train": train, "mismatched": real, "time_reversed": real}
        for row, side in sides.items():
            sizes = 15**order * torch.diff(side[:, :, 1:].double(), order, dim=1).norm(dim=-1)
            assert rows[row][name] == pytest.approx(sizes.mean().item(), rel=1e-5)
        assert rows["attenuated"][name] == pytest.approx(0.8 * rows["mismatched"][name], rel=1e-4)
        assert rows["mean_pose"][name] == 0


def test_batches_of_a_side_are_compared_with_the_real_windows_once():
    encoder = GestureEncoder(PoseAutoencoder(), [0.0] * 27)
    generator = torch.Generator().manual_seed(0)
    made, real = (
        encoded(encoder, torch.randn(n, 34, 10, 3, generator=generator)) for n in (60, 40)
    )
    whole = METRICS.row_of_batches([made], real, without="pairs")
    parts = [made[torch.arange(first, first + 20)] for first in (0, 20, 40)]
    assert METRICS.row_of_batches(parts, real, without="pairs") == pytest.approx(whole, rel=1e-4)


def test_noise_study_shows_what_the_paper_reports(published, people):
    """Section 5.2, claim by claim, on other people and through the published encoder."""
    rows = {(row.disturbance, row.zeta): row for row in run_noise_study(published, people[0])}
    assert len(rows) == sum(map(len, LEVELS.values()))
    for name in ("gaussian", "salt_and_pepper", "temporal", "mismatched"):
        for low, high in zip(LEVELS[name], LEVELS[name][1:], strict=False):
            assert rows[name, low].fgd < rows[name, high].fgd
            assert rows[name, low].joint_mae < rows[name, high].joint_mae
    # "FGD showed larger distances for S&P noise than Gaussian noise, unlike MAEJ"
    gaussian, peppered = rows["gaussian", 0.001], rows["salt_and_pepper", 0.1]
    assert peppered.fgd > 2 * gaussian.fgd
    assert peppered.joint_mae < gaussian.joint_mae
    # "relatively low values for the temporal noise"
    assert rows["temporal", 5].fgd < 0.1 * gaussian.fgd
    # "MAEJ showed similar distances for 0.0 and 2.0, but FGD a much larger one for 0.0"
    still, exaggerated = rows["multiplicative", 0.0], rows["multiplicative", 2.0]
    assert still.joint_mae == pytest.approx(exaggerated.joint_mae, rel=1e-4)
    assert still.fgd > 1.5 * exaggerated.fgd
    # "for mismatched samples the increase in FGD was smaller than MAEJ"
    assert rows["mismatched", 1.0].joint_mae > gaussian.joint_mae
    assert rows["mismatched", 1.0].fgd < 0.2 * gaussian.fgd


def test_unknown_disturbances_are_refused(published, people):
    with pytest.raises(ValueError, match=r"unknown disturbances \['blur'\]"):
        run_noise_study(published, people[0], levels={"blur": (1.0,)})
