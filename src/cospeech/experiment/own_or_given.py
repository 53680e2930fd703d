"""What judges finished runs: their own corpus and encoder, or those that the command gives."""

from __future__ import annotations

import copy
import re
import shlex
from typing import Any

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.store import Store
from cospeech.encoders import is_kept
from cospeech.errors import ConfigError
from cospeech.experiment.building import build, chosen_encoder
from cospeech.experiment.finished_run import FinishedRun
from cospeech.metrics.encoder import GestureEncoder
from cospeech.quoting import quoted


def given(group: str, *but: str) -> list[str]:
    """What the command line says of a group, e.g. ``["data=mocap", "data.root=DIR"]``.

    Args:
        group: Name of the group.
        but: Keys of it that don't count.
    """
    of_group = re.compile(rf"[+~]*{group}(?:$|[.=@])")
    others = tuple(f"{group}.{key}{end}" for key in but for end in "=.")
    return [o for o in _overrides() if of_group.match(o) and not o.lstrip("+").startswith(others)]


def corpus_of(run: FinishedRun, cfg: DictConfig) -> Store:
    """The prepared corpus of a run.

    It is looked for in ``data.store_dir`` and beside the run. Where the command gives a corpus
    (``data=...``), that is prepared, and has to be the run's.

    Args:
        run: The run.
        cfg: Composed from ``conf/evaluate.yaml``.

    Raises:
        ConfigError: It isn't there, or another is given.
    """
    settings = _given_corpus()
    if not settings:
        typed = ["python", "evaluate.py", *_overrides(), *_own_encoder(run, cfg)]
        command = shlex.join(typed)
        return run.require_store([cfg.data.store_dir], command)
    store: Store = build(cfg.data).prepare_store()
    if store.fingerprint != run.fingerprint:
        raise ConfigError(
            f"{' '.join(settings)}: that isn't the corpus of run={run.folder}"
            f" ({store.fingerprint[:10]}, not {(run.fingerprint or 'unknown')[:10]})",
            "leave data out: the run's own is taken; or give all settings that it was trained with",
        )
    return store


def encoder_of(
    run: FinishedRun, cfg: DictConfig, store: Store
) -> tuple[GestureEncoder, DictConfig]:
    """The encoder that a run is judged with, and the settings of the judging.

    They are the run's own, or the command's where it gives any (``metrics...``), with what is usual
    for the run's corpus; which metrics there are is always the command's.

    Args:
        run: The run.
        cfg: Composed from ``conf/evaluate.yaml``.
        store: Its corpus.

    Raises:
        ConfigError: The run's own encoder isn't kept any more, and isn't the usual one.
    """
    values = _judging(run, cfg)
    if not given("metrics", "catalogue"):
        values |= run.metrics
    # Those of the run were checked; a config made of them has no resolver to call.
    metrics = OmegaConf.create(values)
    if not given("metrics", "catalogue"):
        # How long an encoder is trained is not for a record to say.
        own = _own_encoder(run, cfg)
        if own and not is_kept(store, metrics.encoder_epochs, metrics.encoder_seed):
            raise ConfigError(
                f"run={run.folder}: the encoder that it was judged with isn't kept beside"
                f" {store.path} any more",
                f"train it again by adding {shlex.join(own)}, or judge with metrics=default",
            )
    return chosen_encoder(store, metrics), metrics


def _own_encoder(run: FinishedRun, cfg: DictConfig) -> list[str]:
    """What to type for an encoder trained as the run's own was; nothing where it is the usual one.

    Nothing either where the command says which to take.
    """
    usual = _judging(run, cfg)
    own = usual | run.metrics
    if given("metrics", "catalogue") or own["encoder"] != "trained":
        return []
    if all(own[key] == usual[key] for key in ("encoder_epochs", "encoder_seed")):
        return []
    return [f"metrics.{key}={quoted(value)}" for key, value in own.items() if value != usual[key]]


def _judging(run: FinishedRun, cfg: DictConfig) -> dict[str, Any]:
    """The command's ``metrics``; what they take from its ``data`` is of the run's corpus."""
    if not _given_corpus():
        cfg = copy.deepcopy(cfg)
        cfg.data.encoder = run.usual_encoder
    return {str(name): value for name, value in cfg.metrics.items()}


def _given_corpus() -> list[str]:
    """What the command says of the corpus itself."""
    return given("data", "store_dir", "workers", "encoder")


def _overrides() -> list[str]:
    return list(HydraConfig.get().overrides.task) if HydraConfig.initialized() else []
