"""What a run leaves: every number of its record once more, by the protocols' own words.

The oracles below share with the code the encoder, the corpus and the method's motion alone.
"""

import csv
import json

import numpy as np
import pytest
import torch
import yaml

from cospeech.corpus.window_loader import open_windows
from cospeech.experiment import RunInterrupted
from cospeech.methods.trimodal import Trimodal
from cospeech.metrics.encoder import load_encoder
from cospeech.motion.motion import resample_positions
from cospeech.reporting.tables import MISSING, format_value
from tests.trainings import SETTINGS, TRIMODAL, evaluate, train

pytestmark = [
    pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning"),
    pytest.mark.xdist_group("runs"),  # made once, not by every process
]

MOVEMENT = ("acceleration", "jerk")
PAIRED = ("feature_distance", "joint_mae", "acceleration_error")
SETS = ("fgd", "fgd_mean_term", "fgd_covariance_term")


@pytest.fixture(scope="module", params=SETTINGS)
def finished(request, ready):
    return ready.finished(request.param)


@pytest.fixture(scope="module")
def trimodal(ready):
    return ready.finished("trimodal")


# The protocols, in words of their own ------------------------------------------------------------


def cut(positions):
    """Windows of 34 frames, one every ten."""
    return np.stack([positions[i : i + 34] for i in range(0, len(positions) - 33, 10)])


def features(encoder, windows):
    return (
        encoder.encode_positions(torch.from_numpy(np.ascontiguousarray(windows))).double().numpy()
    )


def distance(a, b):
    """The Fréchet distance of two sets of features, and its terms."""
    covariances = np.cov(a.T), np.cov(b.T)
    roots = np.sqrt(np.linalg.eigvals(covariances[0] @ covariances[1]).real.clip(min=0)).sum()
    mean_term = ((a.mean(0) - b.mean(0)) ** 2).sum()
    covariance_term = sum(map(np.trace, covariances)) - 2 * roots
    return {
        "fgd": mean_term + covariance_term,
        "fgd_mean_term": mean_term,
        "fgd_covariance_term": covariance_term,
    }


def kernel(a, b):
    """The unbiased kernel distance of paired sets: no window meets itself or its own pair."""

    def mean(x, y):
        values = (x @ y.T / 32 + 1) ** 3
        return (values.sum() - values.trace()) / (len(x) * (len(x) - 1))

    return mean(a, a) + mean(b, b) - 2 * mean(a, b)


def numbers(encoder, made, real):
    """The values of one row; windows (n, 34, 10, 3) in metres at 15 fps."""
    a, b = features(encoder, made), features(encoder, real)
    error = made.astype(np.float64) - real
    return {
        **distance(a, b),
        "feature_distance": np.abs(a - b).sum(1).mean(),
        "joint_mae": np.abs(error[:, 4:]).mean(),  # without the seed
        "acceleration_error": np.abs(np.diff(error, 2, axis=1)).mean(),
    }


def recorded(store, span):
    return cut(store.upper_body(span.recording, span.start, span.stop))


def spoken(method, store, split):
    """Motion for each whole recording, by its speaker's name, recording i from seed i."""
    made, real = [], []
    for number, span in enumerate(store.splits[split]):
        motion = method.generate(
            store.speech(span),
            speaker=store.recordings.columns["speaker"][span.recording],
            generator=torch.Generator().manual_seed(number),
        )
        made.append(cut(resample_positions(motion.positions, motion.fps, 15)))
        real.append(recorded(store, span))
    return np.concatenate(made), np.concatenate(real)


def sampled(method, store, split, batch_size):
    """Each window given its own seed poses, batch i from seed i."""
    windows = open_windows(store, split, method, frozenset({"positions"}))
    items = max(1, batch_size // windows.spec.run)
    made, real = [], []
    for number, first in enumerate(range(0, len(windows), items)):
        batch = windows.batch(np.arange(first, min(first + items, len(windows))))
        with torch.no_grad():
            poses = method.sample(batch, torch.Generator().manual_seed(number))
        made += [cut(item) for item in poses.numpy()]
        real += [cut(item) for item in batch.positions.numpy()]
    return np.concatenate(made), np.concatenate(real)


def assert_row(row, expected):
    assert {name: row[name] for name in expected} == pytest.approx(expected, rel=2e-3)


# Which weights, which split, whose voice ---------------------------------------------------------


def test_recordings_are_judged_with_the_best_weights_by_each_speakers_name(finished, ready):
    row = finished.record["final"]["recordings"]
    made, real = spoken(finished.method(), ready.store, "test")
    assert_row(row, numbers(ready.encoder, made, real))
    a, b = (features(ready.encoder, windows) for windows in (made, real))
    assert row["kernel_distance"] == pytest.approx(kernel(a, b), rel=1e-2)
    assert row["windows"] == row["windows_real"] == len(made)
    assert row["recordings"] == 2
    assert row["fgd_low"] <= row["fgd_extrapolated"] <= row["fgd_high"]


def test_windows_are_judged_with_the_best_weights_on_the_test_split(finished, ready):
    batch_size = finished.record["config"]["training"]["batch_size"]
    made, real = sampled(finished.method(), ready.store, "test", batch_size)
    assert_row(finished.record["final"]["windows"], numbers(ready.encoder, made, real))


def test_an_epoch_is_judged_with_the_weights_that_it_ended_with(finished, ready):
    batch_size = finished.record["config"]["training"]["batch_size"]
    made, real = sampled(finished.method("last"), ready.store, "val", batch_size)
    last = finished.record["epochs"][-1]
    assert_row(
        {name: last[f"val/{name}"] for name in (*SETS, *PAIRED)}, numbers(ready.encoder, made, real)
    )


def test_the_best_checkpoint_is_that_of_the_epoch_with_the_lowest_monitored_value(finished):
    monitor = finished.record["config"]["training"]["monitor"]
    epochs = [row for row in finished.record["epochs"] if monitor in row]
    lowest = min(epochs, key=lambda row: row[monitor])
    assert finished.result.objective == finished.record["objective"]
    assert finished.record["objective"] == pytest.approx(lowest[monitor])
    kept = {
        name: torch.load(finished.folder / "checkpoints" / f"{name}.ckpt", weights_only=True)
        for name in ("best", "last")
    }
    assert kept["best"]["epoch"] == lowest["epoch"]
    assert kept["last"]["epoch"] == finished.record["epochs"][-1]["epoch"]
    for name, value in finished.result.model.state_dict().items():
        assert torch.equal(value, kept["best"]["state_dict"][name]), name


def test_this_run_ends_worse_than_it_was(trimodal, ready):
    """Or the tests above would not know best from last, nor a voice from another."""
    epochs = trimodal.record["epochs"]
    assert epochs[-1]["val/fgd"] > 1.5 * trimodal.record["objective"]
    last = numbers(ready.encoder, *spoken(trimodal.method("last"), ready.store, "test"))
    assert last["fgd"] > 1.5 * trimodal.record["final"]["recordings"]["fgd"]
    columns = ready.store.recordings.columns
    assert len({columns["speaker"][span.recording] for span in ready.store.splits["test"]}) == 2


# Reference rows ----------------------------------------------------------------------------------


def test_references_are_of_the_test_split_and_the_training_motion(ready, trimodal):
    store, encoder, rows = ready.store, ready.encoder, trimodal.record["references"]
    train_windows, real = (
        np.concatenate([recorded(store, span) for span in store.splits[split]])
        for split in ("train", "test")
    )
    pose = train_windows.mean((0, 1), dtype=np.float64).astype(np.float32)
    still = np.broadcast_to(pose, real.shape)
    for name, made in {
        "mean_pose": still,
        "attenuated": pose + 0.8 * (real - pose),
        "time_reversed": real[:, ::-1].copy(),
    }.items():
        assert_row(rows[name], numbers(encoder, made, real))
    assert_row(
        rows["real_train"], distance(features(encoder, train_windows), features(encoder, real))
    )
    assert rows["real_train"]["windows"] == len(train_windows)
    assert rows["real_train"]["windows_real"] == len(real)
    assert rows["real_halves"]["windows"] + rows["real_halves"]["windows_real"] == len(real)
    assert list(rows) == [
        "real_train", "real_halves", "mismatched", "mean_pose", "noise", "attenuated",
        "frozen_arms", "time_reversed",
    ]  # fmt: skip
    # What is wrong with the motion alone costs less than what is wrong with its speech too.
    for name in PAIRED:
        assert 0 < rows["attenuated"][name] < rows["mismatched"][name]


def test_references_are_the_same_for_every_method(finished, trimodal):
    assert finished.record["references"] == trimodal.record["references"]


# The record, the table, the logs -----------------------------------------------------------------


def test_the_record_says_what_was_run_on_what_and_by_what_it_was_judged(finished, ready):
    record = finished.record
    assert json.loads((finished.folder / "record.json").read_text()) == record
    assert (record["status"], record["error"], record["seed"]) == ("ok", None, 0)
    assert record["id"] == finished.folder.name
    assert record["id"].startswith(f"{record['model']}-synthetic-full-s0-")
    assert record["config"]["run_dir"] == str(finished.folder)
    assert record["data_fingerprint"] == ready.store.fingerprint
    (kept,) = ready.store.path.glob("encoders/autoencoder-e1-s0.pt")
    assert record["encoder"] == {"sha256": load_encoder(kept).sha256, "name": "trained"}
    better = {metric["key"]: metric["better"] for metric in record["metrics"]}
    lower = ("fgd", "fgd_extrapolated", "kernel_distance", *PAIRED)
    assert better == dict.fromkeys(lower, "lower") | dict.fromkeys(MOVEMENT)
    assert record["hardware"]["device"] == "1 x cpu"
    assert record["timings"].keys() == {
        "prepare_corpus", "encoder", "fit", "test", "test_recordings"
    }  # fmt: skip
    assert record["fit"] == {
        "asked": record["config"]["training"]["epochs"],
        "ended": len(record["epochs"]),
    }
    assert [row["epoch"] for row in record["epochs"]] == list(range(len(record["epochs"])))
    assert record["final"]["split"] == "test"
    assert record["samples"][-1] == "samples/player.html"
    for sample in record["samples"]:
        assert (finished.folder / sample).stat().st_size > 10_000


def test_the_table_shows_the_record(finished):
    record = finished.record
    lines = finished.printed.splitlines()
    (heading,) = [number for number, line in enumerate(lines) if "FGD ↓" in line]
    columns = ("fgd", "fgd_extrapolated", "kernel_distance", *PAIRED, *MOVEMENT)
    named = [
        (f"{record['model']} ({protocol})", record["final"][protocol])
        for protocol in ("windows", "recordings")
    ]
    named += [(name.replace("_", " "), row) for name, row in record["references"].items()]
    for line, (name, row) in zip(lines[heading + 2 :], named, strict=False):
        assert line.startswith(name)
        cells = [cell for cell in line[len(name) :].split("  ") if cell]
        shown = [cell.strip() for cell in cells if " to " not in cell and MISSING not in cell]
        assert shown == [format_value(row[column]) for column in columns if column in row]
        interval = [cell.strip() for cell in cells if " to " in cell]
        ends = [format_value(row[end]) for end in ("fgd_low", "fgd_high") if end in row]
        assert interval == ([" to ".join(ends)] if ends else [])
    facts = f"split: test · seed: 0 · encoder: trained {record['encoder']['sha256'][:12]}"
    assert facts in finished.printed
    assert f"run:    {finished.folder}" in finished.printed
    assert f"listen: {finished.folder / 'samples' / 'player.html'}" in finished.printed


def test_the_cost_is_said_at_the_start(trimodal):
    assert "2 epochs x 2 steps = 4 steps" in trimodal.printed
    assert "s per step" in trimodal.printed
    assert "add experiment=trimodal_quick" in trimodal.printed


def test_the_adversary_joins_at_its_epoch(trimodal):
    joined = ["train/discriminator" in row for row in trimodal.record["epochs"]]
    assert joined == [False, True]


def test_the_default_loggers_have_every_value(trimodal):
    names = {name for row in trimodal.record["epochs"] for name in row} - {"epoch"}
    final = trimodal.record["final"]
    names |= {f"test/{name}" for name in final["windows"]}
    names |= {f"test_recordings/{name}" for name in final["recordings"]}
    with (trimodal.folder / "csv" / "version_0" / "metrics.csv").open() as file:
        assert names <= set(next(csv.reader(file)))
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(trimodal.folder / "tensorboard"))
    events.Reload()
    assert names <= set(events.Tags()["scalars"])
    shown = [round(event.value, 9) for event in events.Scalars("val/fgd")]
    assert shown == [round(row["val/fgd"], 9) for row in trimodal.record["epochs"]]
    (of_recordings,) = events.Scalars("test_recordings/fgd")
    assert of_recordings.value == pytest.approx(final["recordings"]["fgd"])
    chosen = {"model": "trimodal", "data": "synthetic", "ablation": "full", "experiment": None}
    for kind in ("tensorboard", "csv/version_0"):
        settings = yaml.safe_load((trimodal.folder / kind / "hparams.yaml").read_text())
        assert chosen.items() <= settings.items()
        assert settings["seed"] == 0


def test_a_criterion_of_a_methods_own_selects(ready):
    for row in ready.finished("knn_cgan").record["epochs"]:
        seam = max(row["val/seam"], 1 / row["val/seam"])
        assert row["val/selection"] == pytest.approx(row["val/fgd"] * seam, rel=1e-4)


def test_the_stages_are_gone_through(ready):
    run = ready.finished("multi_adversary")
    stages = [row["train/stage"] for row in run.record["epochs"]]
    assert stages == sorted(stages)
    assert stages[-1] == 5
    best = torch.load(run.folder / "checkpoints" / "best.ckpt", weights_only=True)
    assert run.record["epochs"][best["epoch"]]["train/stage"] == 5


# Again, further, otherwise -----------------------------------------------------------------------


@pytest.mark.parametrize("name", ["trimodal", "knn", "knn_cgan"])
def test_a_finished_run_is_judged_again_to_the_same_numbers(name, ready):
    run = ready.finished(name)
    again = evaluate(ready.outputs, f"run={run.folder}")
    assert again["recordings"] == pytest.approx(run.record["final"]["recordings"], rel=1e-5)
    folder = max((ready.outputs / "evaluations").iterdir())
    values = json.loads((folder / "evaluation.json").read_text())
    assert values["encoder"] == run.record["encoder"]
    assert values["references"] == run.record["references"]
    assert values["final"] == {"split": "test", "recordings": again["recordings"]}


def test_a_run_judged_on_another_split_has_that_splits_rows(ready):
    run = ready.finished("knn")
    evaluate(ready.outputs, f"run={run.folder}", "split=val")
    values = json.loads(
        (max((ready.outputs / "evaluations").iterdir()) / "evaluation.json").read_text()
    )
    assert values["final"]["split"] == "val"
    real = np.concatenate([recorded(ready.store, span) for span in ready.store.splits["val"]])
    reversed_in_time = numbers(ready.encoder, real[:, ::-1].copy(), real)
    assert_row(values["references"]["time_reversed"], reversed_in_time)
    made, _ = spoken(run.method(), ready.store, "val")
    assert_row(values["final"]["recordings"], numbers(ready.encoder, made, real))


def test_interrupted_and_gone_on_with_a_run_ends_as_if_it_had_not_been(trimodal, ready, tmp_path):
    settings = (*TRIMODAL, "logger=none", f"data.store_dir={ready.outputs / 'stores'}")
    stop = ("_target_=tests.trainings.Interrupt", "epoch=1", "batch=0")
    with pytest.raises(RunInterrupted, match="ckpt_path=last"):
        train(tmp_path, *settings, *(f"+callbacks.stop.{item}" for item in stop))
    (path,) = tmp_path.glob("runs/*/record.json")
    record = json.loads(path.read_text())
    assert record["status"] == "interrupted"
    assert [row["epoch"] for row in record["epochs"]] == [0]
    again = train(tmp_path, *settings, "ckpt_path=last")
    assert again.folder == path.parent
    assert again.record["status"] == "ok"
    assert again.record["final"] == trimodal.record["final"]
    for row, unbroken in zip(again.record["epochs"], trimodal.record["epochs"], strict=True):
        names = [name for name in unbroken if name == "epoch" or name.startswith("val/")]
        assert {name: row[name] for name in names} == {name: unbroken[name] for name in names}
    ends = [
        torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)
        for folder in (again.folder, trimodal.folder)
    ]
    for name, value in ends[1]["state_dict"].items():
        assert torch.equal(ends[0]["state_dict"][name], value), name
    for mine, other in zip(*(end["optimizer_states"] for end in ends), strict=True):
        for key, state in other["state"].items():
            for name, value in state.items():
                assert torch.equal(mine["state"][key][name], value), (key, name)

    before = {file: file.stat().st_mtime_ns for file in again.folder.rglob("*") if file.is_file()}
    nothing = train(tmp_path, *settings, "ckpt_path=last")
    assert (nothing.folder, nothing.objective) == (again.folder, again.objective)
    before.pop(again.folder / ".hydra" / "overrides.yaml", None)
    for file, time in before.items():
        assert ".hydra" in file.parts or file.stat().st_mtime_ns == time, file


def test_a_run_begins_with_the_weights_of_its_seed_on_the_same_split(trimodal, ready):
    first = ("training.epochs=1", "trainer.limit_train_batches=1", "model.learning_rate=0")
    settings = (*TRIMODAL, *first, "~callbacks.spoil", "logger=none", "test=false", "seed=1")
    run = train(ready.outputs, *settings)
    assert run.folder.name.startswith("trimodal-synthetic-full-s1-")
    assert (run.record["seed"], run.record["final"]) == (1, {})
    assert run.record["data_fingerprint"] == trimodal.record["data_fingerprint"]
    drawn = []
    for seed in (0, 1):
        torch.manual_seed(seed)
        made = Trimodal(ready.store.facts(), hidden_size=8, layers=1)
        drawn.append(dict(made.generator.named_parameters()))
    begun = dict(run.model.generator.named_parameters())
    assert all(torch.equal(begun[name], value) for name, value in drawn[1].items())
    assert not all(torch.equal(begun[name], value) for name, value in drawn[0].items())


def test_a_debug_run_judges_as_many_recordings_as_batches(ready):
    row = train(ready.outputs, *SETTINGS["knn"], "+trainer.limit_test_batches=1")
    recordings = row.record["final"]["recordings"]
    span = ready.store.splits["test"][0]
    assert recordings["windows"] == (span.stop - span.start - 34) // 10 + 1
    assert "recordings" not in recordings


def test_a_later_run_takes_the_products_that_are_there(ready):
    run = ready.finished("multi_adversary")
    made = {file: file.stat().st_mtime_ns for file in (ready.outputs / "products").iterdir()}
    stages = sorted(path.name.partition("-")[0] for path in made)
    assert stages == ["classifier", "motion_pretraining", "phase_curriculum", "pretraining"]
    again = train(ready.outputs, *SETTINGS["multi_adversary"])
    assert len(again.record["epochs"]) < len(run.record["epochs"])
    assert {f: f.stat().st_mtime_ns for f in (ready.outputs / "products").iterdir()} == made
    assert again.record["identity"] == run.record["identity"]


def test_the_auto_encoder_trained_by_default_becomes_the_stores_own(ready):
    settings = (*TRIMODAL[: TRIMODAL.index("model=trimodal")], "model=motion_autoencoder")
    settings = (*settings, "metrics.encoder_epochs=2", "logger=none")
    run = train(ready.outputs, *settings)
    (kept,) = ready.store.path.glob("encoders/autoencoder-e2-s0.pt")
    own = load_encoder(run.folder / "encoder.pt")
    assert load_encoder(kept).sha256 == own.sha256
    before = kept.read_bytes()
    other = train(ready.outputs, *settings, "training.batch_size=64").folder / "encoder.pt"
    assert load_encoder(other).sha256 != own.sha256
    assert kept.read_bytes() == before
