"""The frozen encoder and its files."""

import json
import pickle

import pytest
import torch
from torch import nn

from cospeech.errors import CospeechError, InputFileError
from cospeech.metrics.encoder import (
    GestureEncoder,
    PoseAutoencoder,
    import_published,
    load_any,
    load_encoder,
    save_encoder,
)
from cospeech.motion.upper_body import TED_AXES
from tests.parity.formulas import fill

CHECKPOINTS = "data/real/checkpoints"


@pytest.fixture
def encoder():
    mean = [0.01 * i for i in range(27)]
    network = PoseAutoencoder()
    fill(network)
    return GestureEncoder(network, mean, TED_AXES, "formula")


def windows(count=6, seed=0):
    return torch.randn(count, 34, 10, 3, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(
    ("frames", "width", "sizes"), [(34, 64, (170_240, 20_451)), (60, 128, (276_736, 44_811))]
)
def test_parameter_counts_are_the_published_ones(frames, width, sizes):
    network = PoseAutoencoder(frames, width)
    parts = (network.pose_encoder, network.decoder)
    assert tuple(sum(p.numel() for p in part.parameters()) for part in parts) == sizes


def test_positions_become_signed_mean_subtracted_unit_vectors(encoder):
    positions = windows()
    features = encoder.to_features(positions)
    # Bone 4 runs from joint 4 (left shoulder) to joint 5 (left elbow).
    bone = positions[2, 7, 5] - positions[2, 7, 4]
    mean = torch.tensor([0.12, 0.13, 0.14])
    torch.testing.assert_close(
        features[2, 7, 12:15], bone / bone.norm() * torch.tensor(TED_AXES) - mean
    )
    torch.testing.assert_close(encoder.encode_positions(positions), encoder(features))


def test_bone_lengths_do_not_matter(encoder):
    positions = windows()
    torch.testing.assert_close(
        encoder.encode_positions(positions), encoder.encode_positions(positions * 1.7)
    )


def test_stays_frozen_in_a_module_that_trains(encoder):
    before = encoder.sha256
    parent = nn.ModuleDict({"encoder": encoder}).train()
    assert not any(module.training for module in encoder.modules())
    assert not any(parameter.requires_grad for parameter in parent.parameters())
    encoder.encode_positions(windows(40))
    assert encoder.sha256 == before


def test_batch_mates_do_not_change_a_feature(encoder):
    positions = windows(8)
    torch.testing.assert_close(
        encoder.encode_positions(positions)[:1], encoder.encode_positions(positions[:1])
    )


def test_autocast_does_not_change_features(encoder):
    positions = windows()
    plain = encoder.encode_positions(positions)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(encoder.encode_positions(positions), plain)


def test_owns_a_copy_of_the_network():
    network = PoseAutoencoder()
    encoder = GestureEncoder(network, [0.0] * 27)
    before = encoder.sha256
    with torch.no_grad():
        network.pose_encoder.fc_mu.bias.add_(1)
    assert encoder.sha256 == before
    assert network.training
    assert network.pose_encoder.fc_mu.bias.requires_grad


def test_hash_covers_weights_mean_and_axes_but_not_the_source(encoder):
    network, mean = encoder.network, encoder.mean_direction
    assert GestureEncoder(network, mean, TED_AXES, "other").sha256 == encoder.sha256
    assert GestureEncoder(network, mean + 1e-3, TED_AXES).sha256 != encoder.sha256
    assert GestureEncoder(network, mean, (1, 1, 1)).sha256 != encoder.sha256
    assert GestureEncoder(PoseAutoencoder(), mean, TED_AXES).sha256 != encoder.sha256


def test_the_window_that_is_not_finite_is_named(encoder):
    positions = windows()
    positions[3, 2, 1, 0] = float("nan")
    for encode in (encoder.encode_positions, encoder.encode_all):
        with pytest.raises(ValueError, match="window 3 of the batch has"):
            encode(positions)


def test_any_number_of_windows_is_encoded_batch_by_batch(encoder):
    positions = windows(7)
    together = encoder.encode_positions(positions)
    torch.testing.assert_close(encoder.encode_all(positions, batch_size=3), together)


def test_other_window_lengths_are_refused(encoder):
    with pytest.raises(ValueError, match=r"34 frames x 27 numbers, got \(2, 60, 27\)"):
        encoder(torch.zeros(2, 60, 27))


@pytest.mark.parametrize("load", [load_encoder, load_any])
def test_saved_file_gives_the_encoder_back(encoder, tmp_path, load):
    path = tmp_path / "new" / "encoder.pt"
    save_encoder(encoder, path)
    save_encoder(encoder, path)
    assert [entry.name for entry in path.parent.iterdir()] == ["encoder.pt"]
    again = load(path)
    assert again.sha256 == encoder.sha256
    assert again.source == "formula"
    assert torch.equal(again.encode_positions(windows()), encoder.encode_positions(windows()))


def test_a_failed_write_leaves_the_old_file(encoder, tmp_path, monkeypatch):
    path = tmp_path / "encoder.pt"
    save_encoder(encoder, path)
    before = path.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(torch, "save", fail)
    with pytest.raises(CospeechError, match="disk full"):
        save_encoder(encoder, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_changed_weights_are_noticed(encoder, tmp_path):
    path = tmp_path / "encoder.pt"
    save_encoder(encoder, path)
    content = torch.load(path, weights_only=True)
    content["state"]["network.pose_encoder.fc_mu.bias"][3] += 1e-3
    torch.save(content, path)
    with pytest.raises(InputFileError, match="don't match the hash"):
        load_encoder(path)


def test_a_later_format_is_refused(encoder, tmp_path):
    path = tmp_path / "encoder.pt"
    save_encoder(encoder, path)
    content = torch.load(path, weights_only=True)
    content["metadata"] = json.dumps(json.loads(content["metadata"]) | {"version": 2})
    torch.save(content, path)
    with pytest.raises(InputFileError, match="encoder format 2, this version reads 1"):
        load_encoder(path)


class Malicious:
    def __reduce__(self):
        return print, ("executed",)


def test_unsafe_and_broken_files_are_refused_without_running_them(tmp_path, capsys):
    path = tmp_path / "encoder.bin"
    with pytest.raises(InputFileError, match="no such encoder file"):
        load_any(path)
    for content in (b"PK", b"not a checkpoint", pickle.dumps(Malicious(), protocol=2)):
        path.write_bytes(content)
        with pytest.raises(InputFileError, match="can be read safely"):
            load_any(path)
    torch.save({"gen_dict": Malicious()}, path)
    with pytest.raises(InputFileError, match="can be read safely"):
        load_any(path)
    assert capsys.readouterr().out == ""
    for other in ([1, 2], {"weights": torch.zeros(3)}):
        torch.save(other, path)
        with pytest.raises(InputFileError, match=r"holds a list|neither an encoder"):
            load_any(path)
    torch.save({"gen_dict": {"a.weight": torch.zeros(3)}}, path)
    with pytest.raises(CospeechError, match=r"pose_encoder\.net\.0\.0\.weight' is missing"):
        load_any(path)


def test_large_files_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "encoder.bin"
    with path.open("wb") as file:
        file.truncate(65 * 2**20)
    with pytest.raises(InputFileError, match="65 MiB is too large"):
        load_any(path)


def test_published_34_frame_checkpoint(shared):
    encoder = load_any(shared / CHECKPOINTS / "trimodal_h36m_gesture_autoencoder_34f.bin")
    assert encoder.frames == 34
    assert tuple(encoder.axes) == TED_AXES
    # The first bone, spine to neck, of the published mean direction vector (docs/facts/trimodal.md,
    # section 3.2).
    assert encoder.mean_direction[:3].tolist() == pytest.approx([0.0154009, -0.9690125, -0.0884354])
    assert encoder.sha256.startswith("ff7d5b94ec3b29f4")


def test_published_60_frame_checkpoint_is_refused_with_the_reason(shared):
    path = shared / CHECKPOINTS / "sgtoolkit_h36m_gesture_autoencoder_60f.bin"
    with pytest.raises(CospeechError, match="60 frames") as error:
        load_any(path)
    assert "800" in error.value.problem
    assert "384" in error.value.problem
    assert "34-frame" in str(error.value)
    assert import_published(path, frames=60).frames == 60


def test_encoder_of_another_skeleton_is_refused_with_the_reason(shared):
    path = shared / CHECKPOINTS / "genea2023_fgd_model_checkpoint_30.bin"
    with pytest.raises(CospeechError, match=r"168 numbers a frame.*another skeleton"):
        load_any(path)
