"""The refinement in training: who moves when, resuming, scales, and what it puts out."""

import numpy as np
import pytest
import torch
from lightning import Callback, Trainer

from callbacks.step_seed import SeedEachStep
from cospeech.corpus.splits import Span
from cospeech.corpus.window_loader import WindowLoader, open_windows
from cospeech.errors import ConfigError
from cospeech.methods.motion_matching import MotionMatching, RefinedMotionMatching
from cospeech.methods.motion_matching.refinement.scales import Scales
from tests.corpora import make_recording, make_store

SMALL = {
    "generator_width": 8,
    "critic_width": 8,
    "critic_updates": 7,
    "critic_updates_per_generator": 3,
    "chunk_frames": 32,
    "learning_rate": 1e-2,
}


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    takes = [make_recording(f"t{i}", ("ada", "ben")[i % 2], 16, seed=i) for i in range(6)]
    return make_store(tmp_path_factory.mktemp("store"), takes)


class Watch(Callback):
    """Which networks each step moved, and a checkpoint after each."""

    def __init__(self, folder):
        self.folder, self.moved = folder, []

    def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
        self.before = {k: v.clone() for k, v in pl_module.state_dict().items()}

    def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
        after = pl_module.state_dict()
        parameters = dict(pl_module.named_parameters())
        self.moved.append(
            {k.split(".")[0] for k in parameters if not torch.equal(self.before[k], after[k])}
        )
        trainer.save_checkpoint(self.folder / f"{len(self.moved)}.ckpt")


def fit(method, store, *callbacks, ckpt_path=None, epochs=50):
    trainer = Trainer(
        max_epochs=epochs,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=[SeedEachStep(0), *callbacks],
    )
    loader = WindowLoader(open_windows(store, "train", method), 8, 0, True, True)
    trainer.fit(method, loader, ckpt_path=ckpt_path, weights_only=True)
    return trainer


def build(store, **settings):
    torch.manual_seed(0)
    return RefinedMotionMatching(store.facts(), **{**SMALL, **settings})


@pytest.fixture(scope="module")
def trained(store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("steps")
    method, watch = build(store), Watch(folder)
    trainer = fit(method, store, watch)
    return method, watch, trainer


def test_it_stops_by_itself_and_the_generator_moves_in_every_third(trained):
    method, watch, trainer = trained
    assert method.progress.stage == "finished"
    assert method.steps_left == 0
    assert trainer.current_epoch < 50
    both = {"adversary", "generator", "averaged"}
    assert watch.moved == [both, {"adversary"}, {"adversary"}] * 2 + [both]


@pytest.mark.parametrize("step", [1, 3, 5])
def test_a_resumed_run_has_the_same_bits(trained, store, step):
    method, watch, _ = trained
    resumed = build(store)
    fit(resumed, store, ckpt_path=watch.folder / f"{step}.ckpt")
    expected = method.state_dict()
    for name, value in resumed.state_dict().items():
        assert torch.equal(value, expected[name]), name


def test_a_finished_run_that_is_resumed_does_nothing(trained, store):
    method, watch, _ = trained
    resumed = build(store)
    fit(resumed, store, ckpt_path=watch.folder / "7.ckpt")
    for name, value in resumed.state_dict().items():
        assert torch.equal(value, method.state_dict()[name]), name


def test_the_average_follows_closely_at_first(trained, store):
    _, watch, _ = trained
    first = torch.load(watch.folder / "1.ckpt", weights_only=True)["state_dict"]
    name = next(k for k in first if k.startswith("averaged.") and k.endswith("weight"))
    start = build(store).state_dict()[name]
    now = first[name.replace("averaged", "generator")]
    # After the first update: (1 + 0) / (10 + 0) of the old.
    torch.testing.assert_close(first[name], torch.lerp(start, now, 0.9))


@pytest.mark.parametrize(
    ("averaging", "counts", "counts_not"),
    [(0.9, "averaged", "generator"), (0, "generator", "averaged")],
)
def test_the_average_of_the_weights_is_judged_and_speaks(store, averaging, counts, counts_not):
    method = build(store, averaging=averaging)
    windows = open_windows(store, "train", method)
    every = (torch.from_numpy(windows.every_frame(name)) for name in ("poses", "cepstra"))
    method.scales.fit(*every)
    batch, speech = windows.batch(np.arange(2)), store.speech(Span(5, 0, 64))

    def made():
        draws = torch.Generator().manual_seed(2)
        stages = method.stages(speech, None, draws, "ada")
        return method.sample(batch, draws), torch.from_numpy(stages["k-NN + cGAN"])

    before = made()
    for network, same in ((counts_not, True), (counts, False)):
        torch.nn.utils.vector_to_parameters(
            torch.zeros(sum(p.numel() for p in getattr(method, network).parameters())),
            getattr(method, network).parameters(),
        )
        assert [torch.equal(*pair) for pair in zip(before, made(), strict=True)] == [same, same]


def test_statistics_are_those_of_the_training_motion(trained, store):
    method, _, _ = trained
    windows = open_windows(store, "train", method)
    poses = method.scales.poses(torch.from_numpy(windows.every_frame("poses")))
    varies = method.scales.pose_deviation > 0
    assert 0 < varies.sum() < len(varies)
    torch.testing.assert_close(poses.mean(0), torch.zeros_like(poses[0]), atol=1e-3, rtol=0)
    torch.testing.assert_close(
        poses[:, varies].std(0), torch.ones(int(varies.sum())), atol=1e-2, rtol=0
    )
    assert (poses[:, ~varies] == 0).all()
    back = method.scales.joints(poses).numpy()
    np.testing.assert_allclose(back, windows.every_frame("poses"), atol=1e-4)


def test_a_coordinate_that_never_moves_comes_out_as_its_mean():
    scales = Scales(("spine_0", "neck"), 2)
    joints = torch.zeros(50, 2, 3)
    joints[:, 1] = torch.randn(50, 3)
    joints[:, 0, 1] = 1 + 1e-6 * torch.randn(50)
    scales.fit(joints, torch.randn(50, 2))
    put_out = scales.joints(torch.full((1, 6), 3.0))
    assert put_out[0, 0].tolist() == pytest.approx([0, 1, 0], abs=1e-6)


@pytest.mark.parametrize("frames", [1, 7, 64, 101])
def test_stages_are_the_search_and_the_search_refined(trained, store, frames):
    method, _, _ = trained
    speech = store.speech(Span(5, 0, frames))
    stages = method.stages(speech, None, torch.Generator().manual_seed(2), "ada")
    assert list(stages) == ["k-NN", "k-NN + cGAN"]
    search = MotionMatching(store.facts(), chunk_frames=32)
    alone = search.stages(speech, None, torch.Generator().manual_seed(2), "ada")
    np.testing.assert_array_equal(stages["k-NN"], alone["k-NN"])
    assert stages["k-NN + cGAN"].shape == stages["k-NN"].shape == (frames, 10, 3)
    assert not np.allclose(stages["k-NN + cGAN"], stages["k-NN"])


def test_a_residual_refinement_begins_with_what_was_matched(store):
    method = build(store, residual=True)
    speech = store.speech(Span(5, 0, 64))
    windows = open_windows(store, "train", method)
    method.scales.fit(
        torch.from_numpy(windows.every_frame("poses")),
        torch.from_numpy(windows.every_frame("cepstra")),
    )
    stages = method.stages(speech, None, torch.Generator().manual_seed(2), "ada")
    np.testing.assert_allclose(stages["k-NN + cGAN"], stages["k-NN"], atol=2e-4)


def test_the_criterion_is_fgd_times_the_seams_distance_from_one(store):
    method = build(store)
    for at_border, expected in ((0.03, 3.0), (0.01, 1.0), (0.005, 2.0)):
        method._border_steps = [[np.full(3, at_border)], [np.full(3, 0.01)]]
        found = method.derived_values({"fgd": torch.tensor(5.0)})
        assert float(found["selection"]) == pytest.approx(5 * expected)


def test_pairs_are_kept_to_the_speaker_and_away_from_the_window(trained, store):
    method, _, _ = trained
    windows = open_windows(store, "train", method)
    database = method.database
    for i in range(len(windows)):
        pointed = windows.pairs.pointers[i, :, 0]
        recording = windows.recordings[i]
        name = store.recordings[int(recording)].speaker
        assert database.spoken_by(name)[pointed].all()
        own = database.recordings[pointed] == recording
        distances = np.abs(database.starts_s[pointed] - windows.starts_s[i])[own]
        assert (distances >= 64 / 15).all()


def test_settings_out_of_range_are_named(store):
    for wrong in ({"critic_updates": 0}, {"penalty_weight": -1.0}, {"averaging": 1.0}):
        with pytest.raises(ConfigError, match=f"model.{next(iter(wrong))}"):
            build(store, **wrong)
