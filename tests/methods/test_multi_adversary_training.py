"""One run through all stages: what each may move, resuming in each, products."""

import inspect
import json

import numpy as np
import pytest
import torch

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.window_loader import open_windows
from cospeech.errors import ConfigError, CospeechError
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.multi_adversary.staging import STAGES
from cospeech.motion.phases import PHASE_MERGES
from tests import multi_adversary_runs as runs
from tests.corpora import make_store


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return runs.fingerless_store(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="module")
def straight(store, tmp_path_factory):
    """A whole training, a checkpoint after each of its steps, and what was seen of it."""
    folder = tmp_path_factory.mktemp("straight")
    method = runs.build(store)
    watch = runs.fit(method, store, runs.SaveAt(folder), validate=True)
    return method, watch, folder


def weights(method):
    return {name: value.clone() for name, value in method.state_dict().items()}


def assert_equal(method, other):
    a, b = method.state_dict(), other.state_dict()
    assert a.keys() == b.keys()
    for name, value in b.items():
        assert torch.equal(a[name], value), name


def moved(folder, first, last):
    """Which networks differ between two checkpoints."""
    a, b = (
        torch.load(folder / f"{step}.ckpt", weights_only=True)["state_dict"]
        for step in (first, last)
    )
    return {
        ".".join(name.split(".")[1 : 3 if "_adversaries" in name else 2])
        for name in a
        if not torch.equal(a[name], b[name])
    }


def test_one_run_goes_through_all_stages_and_stops_by_itself(straight):
    method, watch, _ = straight
    assert method.progress.stage == "finished"
    order = list(dict.fromkeys(watch.stages))
    assert tuple(order) == STAGES
    counts = {stage: watch.stages.count(stage) for stage in order}
    curriculum = counts.pop("phase_curriculum")
    assert counts == {
        "classifier": 3, "pretraining": 3, "motion_pretraining": 2, "adversarial": 3
    }  # fmt: skip
    assert 3 <= curriculum <= 6
    assert len(watch.epochs) < 20


def test_each_stage_moves_its_own_networks(straight):
    _, watch, folder = straight
    ends = {}
    for step, stage in enumerate(watch.stages, start=1):
        ends[stage] = step
    begins = dict(zip(list(ends)[1:], list(ends.values())[:-1], strict=True))
    assert moved(folder, 1, ends["classifier"]) == {"student"}
    found = {stage: moved(folder, begins[stage], ends[stage]) for stage in list(ends)[1:]}
    assert found == {
        "pretraining": {"generator"},
        "phase_curriculum": {"_adversaries.phase"},
        "motion_pretraining": {"rehearsal", "_adversaries.motion"},
        "adversarial": {
            "generator",
            "_adversaries.phase",
            "_adversaries.motion",
            "_adversaries.minibatch",
            "_adversaries.displacement",
        },
    }


def test_the_classifier_never_changes_after_its_stage(straight):
    method, watch, folder = straight
    done = watch.stages.count("classifier")
    kept = [
        torch.load(folder / f"{step}.ckpt", weights_only=True)["multi_adversary"]["classifier"]
        for step in range(done, len(watch.stages) + 1)
    ]
    for later in kept[1:]:
        for name, value in kept[0]["state"].items():
            assert torch.equal(later["state"][name], value), name
    assert not any(p.requires_grad for p in method.views.classifier.parameters())
    before = torch.load(folder / "1.ckpt", weights_only=True)["multi_adversary"]["classifier"]
    assert before is None


@pytest.mark.slow
def test_every_stage_is_resumed_in_its_middle_to_the_same_bits(store, straight):
    method, watch, folder = straight
    places = {}
    for step in range(1, len(watch.stages)):
        if watch.stages[step - 1] == watch.stages[step]:  # not at a border
            places.setdefault(watch.stages[step], step)
    assert set(places) == set(STAGES)
    for step in places.values():
        torch.manual_seed(99)
        resumed = MultiAdversary(store.facts(), **runs.SMALL)
        seen = runs.fit(resumed, store, checkpoint=folder / f"{step}.ckpt", validate=True)
        assert seen.stages == watch.stages[step:], step
        assert seen.logged == watch.logged[step:], step
        assert_equal(resumed, method)


def test_a_finished_run_has_nothing_left_to_do(store, straight):
    method, watch, folder = straight
    again = runs.build(store)
    seen = runs.fit(again, store, checkpoint=folder / f"{len(watch.stages)}.ckpt", epochs=50)
    assert seen.stages == []
    assert_equal(again, method)


def test_dropout_changes_with_the_stage(store):
    rates = {}

    class Look(runs.Watch):
        def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
            generator = pl_module.players.generator
            pair = (generator.dense_dropout.p, generator.recurrent_dropout.p)
            rates.setdefault(self.stages[-1], set()).add(pair)

    runs.fit(runs.build(store), store, Look())
    assert rates.pop("pretraining") == {(0.3, 0.5)}
    assert set.union(*rates.values()) == {(0.2, 0.2)}


def test_an_objective_step_follows_every_second_adversarial_one_on_the_same_batch(store):
    method = runs.build(store, adversarial_steps=6)
    batches = []
    forward = method.players.generator.forward
    method.players.generator.forward = lambda speech: (batches.append(speech), forward(speech))[1]
    watch = runs.fit(method, store)
    rows = [row for row in watch.logged if "train/adversarial" in row]
    assert ["train/correction" in row for row in rows] == [False, True] * 3
    last = batches[-9:]  # adversarial; adversarial and objective: three times
    for first in (1, 4, 7):
        assert torch.equal(last[first], last[first + 1])
    assert not torch.equal(last[0], last[1])


def test_the_epochs_tell_of_their_own_stages_only(straight):
    _, watch, _ = straight
    first, last = watch.epochs[0], watch.epochs[-1]
    assert "train/classifier_loss" in first
    assert "train/classifier_loss" not in last
    assert {"train/phase_real_accuracy", "train/minibatch_fake_accuracy", "train/mse"} <= set(last)
    assert first["train/stage"] == 1
    assert last["train/stage"] == 5
    for epoch in watch.epochs:
        for source in ("generated", "real"):
            shares = [
                value
                for name, value in epoch.items()
                if name.startswith("val/phase_share") and name.endswith(source)
            ]
            assert sum(shares) == pytest.approx(1, abs=1e-5)


def test_only_the_second_half_of_the_last_stage_can_be_the_best_epoch(store):
    method = runs.build(store, adversaries=dict.fromkeys(ADVERSARIES), adversarial_steps=8)
    method.schedule.lengths.pop("pretraining")
    method.progress = type(method.progress)("adversarial")
    watch = runs.fit(method, store, validate=True)
    assert (len(watch.stages), len(watch.epochs)) == (8, 3)  # after 3, 6 and 8 steps
    gaps = [epoch["val/wrist_speed_gap"] for epoch in watch.epochs]
    assert all(0 < gap < 100 for gap in gaps)
    chosen = [epoch["val/adversarial_gap"] for epoch in watch.epochs]
    assert chosen == [1e9, *gaps[1:]]


def test_a_later_run_skips_what_was_done_and_starts_from_the_same(store, tmp_path):
    folder = tmp_path / "products"
    first = runs.fit(one := runs.build(store, products_dir=str(folder)), store)
    kept = {path.name.split("-")[0] for path in folder.iterdir()}
    assert kept == set(STAGES[:4])
    second = runs.fit(two := runs.build(store, products_dir=str(folder)), store)
    assert set(first.stages) == set(STAGES)
    assert set(second.stages) == {"adversarial"}
    for a, b in zip(
        one.views.classifier.state_dict().values(),
        two.views.classifier.state_dict().values(),
        strict=True,
    ):
        assert torch.equal(a, b)
    ablated = {**runs.SMALL["adversaries"], "minibatch": None}
    third = runs.fit(runs.build(store, products_dir=str(folder), adversaries=ablated), store)
    assert set(third.stages) == {"adversarial"}


@pytest.mark.slow
def test_other_settings_another_seed_or_another_corpus_have_products_of_their_own(store, tmp_path):
    folder = str(tmp_path)
    runs.fit(runs.build(store, products_dir=folder), store)
    longer = runs.fit(runs.build(store, products_dir=folder, pretraining_steps=4), store)
    assert set(longer.stages) == {"pretraining", "phase_curriculum", "adversarial"}
    torch.manual_seed(1)
    reseeded = MultiAdversary(store.facts(), **{**runs.SMALL, "products_dir": folder})
    assert set(runs.fit(reseeded, store).stages) == set(STAGES)
    torch.manual_seed(0)
    facts = {**store.facts(), "fingerprint": "1" * 64}
    elsewhere = MultiAdversary(facts, **{**runs.SMALL, "products_dir": folder})
    assert set(runs.fit(elsewhere, store).stages) == set(STAGES)


def test_every_setting_is_known_to_products_or_has_no_part_in_them():
    """A new setting is to be put into one of the two, or old products would pass for new ones."""
    settings = set(inspect.signature(MultiAdversary.__init__).parameters) - {"self"}
    known = {name for names in MultiAdversary.product_settings.values() for name in names}
    elsewhere = {
        "corpus", "run", "stride",  # what the training sees, which is in every key
        "adversaries", "classifier",  # by what they come to, see `further_facts`
        "products_dir", "curriculum", "adversarial_steps", "steps_per_correction",
        "continuity_weight", "finger_weight", "correction_learning_rate", "long_form",
    }  # fmt: skip
    assert settings == known | elsewhere
    assert not known & elsewhere


def test_each_setting_and_each_fact_of_the_data_changes_the_key(store):
    method = runs.build(store)
    method.views.classifier = method.players.student.frozen()
    facts = {"precision": "32-true", "windows": [2, 40, 9]}
    for stage, names in MultiAdversary.product_settings.items():
        method.training_facts = facts
        key = method.product_key(stage)
        method.training_facts = {**facts, "precision": "bf16-mixed"}
        assert method.product_key(stage) != key
        method.training_facts = facts
        for name in names:
            value, method.hparams[name] = method.hparams[name], "another"
            assert method.product_key(stage) != key, (stage, name)
            method.hparams[name] = value
        assert method.product_key(stage) == key
    # A named classifier counts with what it reads, not by its weights alone.
    method.players.student = None
    key = method.product_key("phase_curriculum")
    method.views.classifier.merge = PHASE_MERGES["five"]
    assert method.product_key("phase_curriculum") != key


def test_an_adversarys_product_is_of_its_loss_and_sizes_and_not_of_its_weight(store):
    def key(**changes):
        method = runs.build(
            store, adversaries={**ADVERSARIES, "motion": {**ADVERSARIES["motion"], **changes}}
        )
        return method.product_key("motion_pretraining")

    assert key(weight=9) == key()
    assert len({key(), key(loss="least_squares"), key(hidden=5)}) == 3


def test_a_damaged_product_is_named_and_made_again(store, tmp_path, caplog):
    runs.fit(runs.build(store, products_dir=str(tmp_path)), store)
    (path,) = tmp_path.glob("pretraining-*.pt")
    whole = path.read_bytes()
    path.write_bytes(whole[:1000])
    runs.fit(runs.build(store, products_dir=str(tmp_path)), store)
    assert any(path.name in message and "damaged" in message for message in caplog.messages)
    assert len(path.read_bytes()) == len(whole)


@pytest.mark.slow
def test_a_resumed_run_does_not_skip_what_it_would_have_done(store, straight, tmp_path):
    """Products that appeared after it began change nothing."""
    method, watch, folder = straight
    runs.fit(runs.build(store, products_dir=str(tmp_path)), store)
    resumed = runs.build(store, products_dir=str(tmp_path))
    seen = runs.fit(resumed, store, checkpoint=folder / "2.ckpt", validate=True)
    assert seen.stages == watch.stages[2:]
    assert_equal(resumed, method)


ADVERSARIES = runs.SMALL["adversaries"]


@pytest.mark.parametrize(
    ("changes", "stages"),
    [
        (
            {"adversaries": {**ADVERSARIES, "phase": None}},
            {"pretraining", "motion_pretraining", "adversarial"},
        ),
        (
            {"adversaries": {**ADVERSARIES, "motion": None}},
            {"classifier", "pretraining", "phase_curriculum", "adversarial"},
        ),
        ({"curriculum": False}, set(STAGES) - {"phase_curriculum"}),
        ({"adversaries": dict.fromkeys(ADVERSARIES)}, {"pretraining", "adversarial"}),
    ],
)
def test_what_is_left_out_needs_no_stage(store, changes, stages):
    method = runs.build(store, **changes)
    watch = runs.fit(method, store)
    assert set(watch.stages) == stages
    assert ("phases" in method.needs) == ("classifier" in stages)
    last = watch.logged[-2]
    gone = [name for name in ADVERSARIES if name not in method.players.adversaries]
    assert not [key for key in last if any(f"/{name}_" in key for name in gone)]


def test_without_adversaries_only_objective_steps_are_made(store):
    watch = runs.fit(
        runs.build(store, adversaries=dict.fromkeys(ADVERSARIES), adversarial_steps=4), store
    )
    rows = [row for row, stage in zip(watch.logged, watch.stages, strict=True)
            if stage == "adversarial"]  # fmt: skip
    assert [set(row) for row in rows] == [
        set(),
        {"train/mse", "train/continuity", "train/correction"},
    ] * 2


def test_ablations_start_from_the_same_networks(store):
    full = runs.build(store).players
    ablated = runs.build(store, adversaries={**ADVERSARIES, "phase": None}).players
    for name in ("motion", "minibatch", "displacement"):
        assert_equal(ablated.adversaries[name], full.adversaries[name])
    assert_equal(ablated.generator, full.generator)


@pytest.mark.parametrize("name", list(ADVERSARIES))
def test_an_adversary_of_weight_0_watches_and_is_not_felt(store, name):
    watching = {**ADVERSARIES, name: {**ADVERSARIES[name], "weight": 0}}
    without = {**ADVERSARIES, name: None}
    # No dropout: the adversary that watches draws its own, and so moves the others' draws.
    silent = [
        {key: value and {**value, "dropout": 0.0} for key, value in settings.items()}
        for settings in (watching, without)
    ]
    rates = {"pretraining_dropout": (0.0, 0.0), "adversarial_dropout": (0.0, 0.0)}
    common = {"adversarial_steps": 2, "curriculum": False, **rates}
    methods = [runs.build(store, adversaries=settings, **common) for settings in silent]
    watches = []
    for method in methods:
        # Straight into the last stage: the stages before differ.
        method.schedule.lengths.pop("classifier", None)
        for stage in ("pretraining", "motion_pretraining"):
            method.schedule.lengths.pop(stage, None)
        method.progress = type(method.progress)("adversarial")
        method.views.classifier = runs.build(store).players.student.frozen()
        watches.append(runs.fit(method, store))
    assert f"train/{name}_adversarial" in watches[0].logged[0]
    assert f"train/{name}_adversarial" not in watches[1].logged[0]
    assert_equal(methods[0].players.generator, methods[1].players.generator)


def test_continuity_of_weight_0_is_logged_and_not_felt(store):
    def generators(weight):
        method = runs.build(store, adversaries=dict.fromkeys(ADVERSARIES), continuity_weight=weight)
        return method, runs.fit(method, store)

    method, watch = generators(0.0)
    felt, _ = generators(5.0)
    assert watch.logged[-2]["train/continuity"] > 0
    assert watch.logged[-2]["train/correction"] == watch.logged[-2]["train/mse"]
    a, b = (weights(m.players.generator) for m in (method, felt))
    assert any(not torch.equal(a[name], b[name]) for name in a)


def test_without_fingers_the_joints_shrink_and_there_is_no_finger_penalty(straight):
    method, watch, _ = straight
    assert method.layout.roles == (
        "left_shoulder", "left_elbow", "left_wrist",
        "right_shoulder", "right_elbow", "right_wrist",
        "spine_0", "neck",
    )  # fmt: skip
    assert method.players.generator.output.out_features == 24
    assert not any("fingers" in name for row in watch.logged for name in row)


def test_fingers_are_held_by_their_penalty_and_hard_labels_train(tmp_path):
    store = runs.embedded_store(tmp_path)
    settings = {"hidden_size": 8, "adversarial_steps": 2, "run": 1, "labels": "hard"}
    logs = {}
    for weight in (0.0, 1.0):
        method = runs.build(store, finger_weight=weight, **settings)
        logs[weight] = runs.fit(method, store).logged[-1]
        assert len(method.layout.finger_tips) == 10
    for weight, row in logs.items():
        parts = row["train/mse"] + row["train/continuity"] + weight * row["train/fingers"]
        assert row["train/correction"] == pytest.approx(parts, rel=1e-5)
        assert row["train/fingers"] > 0
        assert np.isfinite(list(row.values())).all()


def test_a_classifier_learns_from_what_is_annotated_and_the_generator_from_all(tmp_path):
    takes = [runs.labelled_recording(f"take{i}", i, labelled=i % 2 == 0) for i in range(6)]
    store = make_store(tmp_path, takes)
    full, without = runs.build(store), runs.build(store, adversaries={"motion": {"weight": 1}})
    datasets = [open_windows(store, "train", method) for method in (full, without)]
    assert len(datasets[0]) == len(datasets[1])
    batch = datasets[0].batch(range(len(datasets[0])))
    known = (batch.phases >= 0).all(dim=1)
    assert 0 < int(known.sum()) < len(known)
    full.players.fit_scales([batch], list(full.layout.arms))
    student = full.players.student.eval()
    annotated = GestureBatch(
        batch.window_ids[known], **{name: values[known] for name, values in batch.fields.items()}
    )
    for one, other in zip(student.loss(batch, 0, 1), student.loss(annotated, 0, 1), strict=True):
        torch.testing.assert_close(one, other)
    none = batch.having(
        **{name: getattr(batch, name)[~known] for name in ("joints", "acoustics", "phases")}
    )
    assert float(student.loss(none, 0, 1)[0]) == 0
    watch = runs.fit(full, store, validate=True)
    assert watch.stages[-1] == "adversarial"
    assert 0 <= watch.epochs[-1]["val/classifier_accuracy"] <= 1


def test_a_named_classifier_takes_the_stages_place(store, straight, tmp_path):
    trained = straight[0].views.classifier
    trained.save(tmp_path / "phases.pt")
    method = runs.build(store, classifier=str(tmp_path / "phases.pt"))
    assert "phases" not in method.needs
    watch = runs.fit(method, store, runs.SaveAt(tmp_path))
    assert set(watch.stages) == set(STAGES[1:5])
    for name, value in trained.state_dict().items():
        assert torch.equal(method.views.classifier.state_dict()[name], value)
    # A resumed run has it in its checkpoint.
    (tmp_path / "phases.pt").unlink()
    resumed = runs.build(store, classifier=str(tmp_path / "phases.pt"))
    runs.fit(resumed, store, checkpoint=tmp_path / "4.ckpt")
    assert_equal(resumed, method)
    fresh = runs.build(store, classifier=str(tmp_path / "phases.pt"))
    with pytest.raises(CospeechError, match=r"phases\.pt"):
        runs.fit(fresh, store)


def test_a_classifier_of_other_classes_is_refused_with_the_setting(store, tmp_path):
    other = runs.build(store, phase_classes="stroke").players.student.frozen()
    other.save(tmp_path / "stroke.pt")
    method = runs.build(store, classifier=str(tmp_path / "stroke.pt"))
    with pytest.raises(ConfigError, match=r"'stroke', not 'four'(.|\n)*phase_classes=stroke"):
        runs.fit(method, store)


def test_a_corpus_without_phases_is_refused_at_the_start(tmp_path):
    bare = runs.fingerless_store(tmp_path, labelled=False)
    with pytest.raises(ConfigError, match=r"needs gesture phases") as caught:
        runs.loader(runs.build(bare), bare, "train")
    assert "classifier" in caught.value.hint
    watch = runs.fit(runs.build(bare, adversaries={"motion": {"weight": 1}}), bare)
    assert set(watch.stages) == {"pretraining", "motion_pretraining", "adversarial"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"run": 5}, r"model.run=5: must be from 1 to 4"),
        ({"run": 0}, r"model.run=0"),
        ({"snapshots": 1}, r"model.snapshots=1: must be from 2 to 1000"),
        ({"adversarial_steps": 0}, r"model.adversarial_steps=0"),
        ({"labels": "crisp"}, r"model.labels='crisp' is not one of soft, hard"),
        ({"phase_classes": "seven"}, r"phase_classes='seven'.*four"),
        ({"long_form": "glue"}, r"long_form='glue'.*crossfade"),
        ({"classifier_sizes": {"deep": 3}}, r"classifier_sizes has no deep; there are dense"),
    ],
)
def test_impossible_settings_are_refused(store, changes, message):
    with pytest.raises(ConfigError, match=message):
        runs.build(store, **changes)


def test_too_few_epochs_are_said_at_the_start(store, caplog):
    runs.fit(runs.build(store), store, epochs=1)
    assert "raise training.epochs" in caplog.text


def test_checkpoints_hold_plain_values_only(straight):
    _, watch, folder = straight
    state = torch.load(folder / "5.ckpt", weights_only=True)["multi_adversary"]
    assert json.loads(json.dumps(state["curriculum"]))["level"] == 0
    stages = torch.load(folder / "5.ckpt", weights_only=True)["stages"]
    assert json.loads(json.dumps(stages))["stage"] == "pretraining"
    assert len(state["history"]) == 2  # before the first step and after it; then after the third
    last = torch.load(folder / f"{len(watch.stages)}.ckpt", weights_only=True)
    assert last["multi_adversary"]["history"] == []
