"""Every yaml on disk composes, and every ablation does something."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from cospeech.experiment.settings import known_arguments

CONF = Path(__file__).resolve().parents[1] / "conf"


def names(group: str) -> list[str]:
    found = {path.stem for path in (CONF / group).glob("*.yaml")}
    return sorted(found - {"base"})  # conf/data/base.yaml is what the others have in common


def composed(*overrides: str, config: str = "train"):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose(config, overrides=list(overrides))


def plain(cfg, key: str):
    return OmegaConf.to_container(cfg[key], resolve=False)


@pytest.mark.parametrize("model", names("model"))
@pytest.mark.parametrize("data", names("data"))
def test_every_model_composes_with_every_corpus(model, data):
    cfg = composed(f"model={model}", f"data={data}")
    assert cfg.model._target_.startswith(("cospeech.methods.", "cospeech.judges."))
    assert cfg.data._target_.startswith("data_modules.")
    assert set(cfg.training) == {"epochs", "batch_size", "monitor", "quick"}


def test_the_seed_of_a_run_draws_its_batches_and_its_steps_and_leaves_the_split_alone():
    cfg = composed("model=knn", "seed=3")
    assert (cfg.data.seed, cfg.callbacks.step_seed.seed, cfg.data.split_seed) == (3, 3, 0)


@pytest.mark.parametrize("data", names("data"))
def test_the_yaml_of_a_corpus_has_every_argument_of_its_class(data):
    values = composed("model=knn", f"data={data}").data
    assert set(values) - {"_target_"} == set(known_arguments(values._target_))


@pytest.mark.parametrize("data", names("data"))
def test_the_embedded_corpus_is_judged_by_the_packaged_encoder_and_any_other_by_its_own(data):
    usual = "packaged" if data == "synthetic" else "trained"
    for config, model in (("train", ["model=knn"]), ("evaluate", [])):
        assert composed(*model, f"data={data}", config=config).metrics.encoder == usual


@pytest.mark.parametrize(
    ("data", "asked"), [("synthetic", "trained"), ("synthetic", "mine.pt"), ("mocap", "packaged")]
)
def test_the_encoder_that_is_asked_for_is_taken(data, asked):
    cfg = composed("model=knn", f"data={data}", f"metrics.encoder={asked}")
    assert cfg.metrics.encoder == asked


@pytest.mark.parametrize(
    ("group", "name"),
    [
        (group, name)
        for group in ("trainer", "metrics", "callbacks", "logger", "debug")
        for name in names(group)
    ],
)
def test_every_choice_of_the_other_groups_composes(group, name):
    cfg = composed("model=trimodal", f"{group}={name}")
    written = OmegaConf.load(CONF / group / f"{name}.yaml")
    keys = set(written) - {"defaults"}
    assert keys <= set(cfg if group == "debug" else cfg[group])


@pytest.mark.parametrize("name", names("experiment"))
def test_every_experiment_changes_what_it_names(name):
    model = name.split("_quick")[0]
    plain_run, changed = (
        composed(f"model={model}"),
        composed(f"model={model}", f"experiment={name}"),
    )
    assert plain(plain_run, "model") != plain(changed, "model")
    assert set(plain(plain_run, "model")) == set(plain(changed, "model"))


@pytest.mark.parametrize("name", [name for name in names("ablation") if name != "full"])
def test_every_ablation_key_exists_in_its_model_and_changes_its_value(name):
    model = name.split("__")[0]
    control = plain(composed(f"model={model}"), "model")
    ablated = plain(composed(f"model={model}", f"ablation={name}"), "model")
    written = OmegaConf.to_container(OmegaConf.load(CONF / "ablation" / f"{name}.yaml"))["model"]
    assert set(ablated) == set(control)
    for keys, value in leaves(written):
        before, after = control, ablated
        for key in keys:
            before, after = before[key], after[key]
        assert after == value != before


def leaves(values: dict, above: tuple = ()):
    """(path of keys, value) of everything that is no dict."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from leaves(value, (*above, key))
        else:
            yield (*above, key), value


def test_the_control_changes_nothing():
    assert OmegaConf.load(CONF / "ablation" / "full.yaml") == {}


def test_an_ablation_wins_over_an_experiment():
    cfg = composed("model=trimodal", "experiment=trimodal_quick", "ablation=trimodal__no_audio")
    assert cfg.model.context == "text"
    assert cfg.model.hidden_size == 96


def test_the_paper_study_sweeps_every_row_over_seeds():
    study = OmegaConf.load(CONF / "study" / "trimodal_ablations.yaml")
    assert study.hydra.mode == "MULTIRUN"
    assert study.hydra.sweeper.params.ablation == "glob([full,trimodal__*])"
    rows = {"no_text", "no_audio", "no_speaker_id", "no_adversarial", "no_regularisers"}
    assert {f"trimodal__{row}" for row in rows} <= set(names("ablation"))


def test_the_study_of_gesticulator_has_the_rows_of_its_table_3():
    study = OmegaConf.load(CONF / "study" / "gesticulator_ablations.yaml")
    assert study.hydra.sweeper.params.ablation == "glob([full,gesticulator__*])"
    rows = {
        "with_pca": {"pca": 12},
        "no_velocity": {"velocity_weight": 0},
        "no_autoregression": {"conditioning": "none"},
        "no_film": {"conditioning": "concatenation"},
        "no_text": {"text": "none"},
        "no_audio": {"audio": "none"},
    }
    for row, settings in rows.items():
        model = composed("model=gesticulator", f"ablation=gesticulator__{row}").model
        assert {key: model[key] for key in settings} == settings


def test_mse_only_leaves_nothing_but_the_squared_error():
    model = composed("model=multi_adversary", "ablation=multi_adversary__mse_only").model
    assert set(model.adversaries.values()) == {None}
    assert (model.continuity_weight, model.finger_weight) == (0, 0)


def test_every_quick_variant_composes():
    for model in names("model"):
        quick = composed(f"model={model}").training.quick
        if quick is not None:
            small = composed(f"model={model}", *quick.split())
            whole = composed(f"model={model}")
            if whole.training.epochs < 0:  # the method knows its end
                (length,) = {"adversarial_steps", "critic_updates"} & set(whole.model)
                assert small.model[length] < whole.model[length]
            else:
                assert 0 < small.training.epochs < whole.training.epochs


def test_the_other_command_lines_compose():
    studies = ("fgd_noise", "control_adherence", "matching_synchrony", "motion_statistics")
    for study in (*studies, "caused_gestures"):
        target = composed(f"study={study}", config="evaluate").study_task._target_
        assert target == f"cospeech.studies.{study}"
    assert composed("run=x", "audio=y", config="generate").checkpoint == "best"
    assert composed("data=mocap", "data.root=x", config="prepare").data.root == "x"


def test_a_misspelt_key_is_refused():
    with pytest.raises(Exception, match="hiden_size"):
        composed("model=trimodal", "model.hiden_size=3")
