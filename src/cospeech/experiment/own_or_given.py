"""What judges finished runs: their own corpus and encoder, or those that the command gives."""

from __future__ import annotations

import re
import shlex

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
    settings = given("data", "store_dir", "workers")
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

    They are the run's own, or the command's where it gives any (``metrics...``); which metrics
    there are is always the command's.

    Args:
        run: The run.
        cfg: Composed from ``conf/evaluate.yaml``.
        store: Its corpus.

    Raises:
        ConfigError: The run's own encoder isn't kept any more, and isn't the usual one.
    """
    metrics = cfg.metrics
    if not given("metrics", "catalogue"):
        # Values that were checked; a config made of them has no resolver to call.
        metrics = OmegaConf.create({**metrics, **run.metrics})
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
    own = {**cfg.metrics, **run.metrics}
    trained = [key for key in own if key.startswith("encoder")]
    if given("metrics", "catalogue") or own["encoder"] != "trained":
        return []
    if all(own[key] == cfg.metrics[key] for key in trained):
        return []
    return [
        f"metrics.{key}={quoted(value)}" for key, value in own.items() if value != cfg.metrics[key]
    ]


def _overrides() -> list[str]:
    return list(HydraConfig.get().overrides.task) if HydraConfig.initialized() else []
