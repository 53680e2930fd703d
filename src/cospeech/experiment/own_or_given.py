"""What judges finished runs: their own corpus and encoder, or those that the command gives."""

from __future__ import annotations

import copy
import logging
import re
import shlex
from contextlib import suppress
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from cospeech.corpus.store import Store
from cospeech.encoders import is_kept
from cospeech.errors import ConfigError
from cospeech.evaluation import Catalogue, standard_catalogue
from cospeech.experiment.building import build, chosen_catalogue, chosen_encoder
from cospeech.experiment.finished_run import JUDGING, FinishedRun
from cospeech.experiment.known_parts import names_of
from cospeech.experiment.typed import read_overrides
from cospeech.metrics.encoder import GestureEncoder
from cospeech.quoting import setting

logger = logging.getLogger(__name__)

_SHOWN = 5
"""Metrics of a run that are named; a record may hold any number."""

_KEY = re.compile(r"[A-Za-z_]\w*", re.ASCII)
"""Names of metrics that can be typed."""


def given(group: str, *but: str) -> list[str]:
    """What the command line says of a group, e.g. ``["data=mocap", "data.root=DIR"]``.

    Args:
        group: Name of the group.
        but: Keys of it that don't count.
    """
    of_group = re.compile(rf"[+~]*{group}(?:$|[.=@])")
    others = re.compile(rf"[+~]*{group}\.(?:{'|'.join(but)})(?:$|[.=])")
    return [o for o in _overrides() if of_group.match(o) and not others.match(o)]


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
        typed = shlex.join(["python", "evaluate.py", *_overrides()])
        command = " ".join([typed, *_own_encoder(run, cfg)])
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

    They are the run's own, or the command's where it says how to judge (``metrics.encoder=...``, or
    a yaml of metrics that does), with what is usual for the run's corpus. Which metrics there are
    is always the command's, and says nothing of the encoder.

    Args:
        run: The run.
        cfg: Composed from ``conf/evaluate.yaml``.
        store: Its corpus.

    Raises:
        ConfigError: The run's own encoder isn't kept any more, and isn't the usual one.
    """
    values = usual = _judging(run, cfg)
    says_how = _says_how_to_judge()
    if not says_how:
        values = usual | run.metrics
    # Those of the run were checked; a config made of them has no resolver to call.
    metrics = OmegaConf.create(values)
    if not says_how:
        # How long an encoder is trained is not for a record to say.
        own = _own_encoder(run, cfg)
        if own and not is_kept(store, metrics.encoder_epochs, metrics.encoder_seed):
            raise ConfigError(
                f"run={run.folder}: the encoder that it was judged with isn't kept beside"
                f" {store.path} any more",
                f"train it again by adding {' '.join(own)}, or judge with"
                f" {setting('metrics.encoder', usual.get('encoder', run.usual_encoder))}",
            )
    return chosen_encoder(store, metrics), metrics


def catalogue_of(run: FinishedRun, cfg: DictConfig) -> Catalogue:
    """The command's metrics.

    Where the run had further ones, a warning says how to have them again: what a record names is
    never imported.

    Args:
        run: The run.
        cfg: Composed from ``conf/evaluate.yaml``.
    """
    catalogue = chosen_catalogue(cfg.metrics)
    known = {
        column["key"] for each in (catalogue, standard_catalogue()) for column in each.described()
    }
    typed = {str(override.key_or_group) for override in read_overrides(_overrides())}
    left_out = [
        name
        for name in run.columns
        if name not in known and f"metrics.catalogue.{name}" not in typed
    ]
    if left_out:
        more = f" and {len(left_out) - _SHOWN} more" if len(left_out) > _SHOWN else ""
        logger.warning(
            "run=%s was also judged by %s%s, which this command doesn't name: add %s",
            run.folder,
            ", ".join(left_out[:_SHOWN]),
            more,
            _adding(left_out),
        )
    return catalogue


def _adding(names: list[str]) -> str:
    """What to type so that a command has further metrics."""
    for choice in names_of("metrics") if GlobalHydra.instance().is_initialized() else []:
        # Another's mistake in a yaml that wasn't asked for is not this command's.
        with suppress(HydraException, OmegaConfBaseException, YAMLError):
            if set(names) <= (_yaml_of_metrics(choice).get("catalogue") or {}).keys():
                return setting("metrics", choice)
    lines = [
        f"+metrics.catalogue.{name}._target_=..." for name in names[:_SHOWN] if _KEY.fullmatch(name)
    ]
    return " ".join(lines) or "their lines to a yaml in conf/metrics, and metrics=NAME"


def _own_encoder(run: FinishedRun, cfg: DictConfig) -> list[str]:
    """What to type for an encoder trained as the run's own was; nothing where it is the usual one.

    Nothing either where the command says which to take. Quoted for a shell.
    """
    usual = _judging(run, cfg)
    own = usual | run.metrics
    if _says_how_to_judge() or own["encoder"] != "trained":
        return []
    if all(own[key] == usual.get(key) for key in ("encoder_epochs", "encoder_seed")):
        return []
    return [setting(f"metrics.{key}", own[key]) for key in JUDGING if own[key] != usual.get(key)]


def _says_how_to_judge() -> bool:
    """Whether the command says anything of the encoder or of the references.

    A value that is taken away (``~metrics.encoder``) leaves the run's own, and so does a yaml of
    metrics with the values of ``conf/metrics/default.yaml``.
    """
    for override in read_overrides(_overrides()):
        group, _, key = str(override.key_or_group).partition(".")
        if group != "metrics" or override.is_delete():
            continue
        if key in JUDGING:
            return True
        if not key and _judged_otherwise(str(override.value())):
            return True
    return False


def _judged_otherwise(choice: str) -> bool:
    """Whether a yaml of metrics says something else of how to judge than the default one."""
    usual, chosen = _yaml_of_metrics("default"), _yaml_of_metrics(choice)
    return any(chosen.get(key, usual[key]) != usual[key] for key in JUDGING)


def _yaml_of_metrics(choice: str) -> dict[str, Any]:
    """What a choice of metrics says, with nothing typed; interpolations as written."""
    loader = GlobalHydra.instance().config_loader()
    chosen = [*_search_path(), setting("metrics", choice)]
    config = loader.load_configuration("evaluate", chosen, RunMode.RUN)
    values: Any = OmegaConf.to_container(config.metrics, resolve=False)
    return dict(values)


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


def _search_path() -> list[str]:
    """What the command says of where yaml files lie."""
    given = HydraConfig.get().overrides.hydra if HydraConfig.initialized() else []
    return [text for text in given if text.lstrip("+").startswith("hydra.searchpath=")]
