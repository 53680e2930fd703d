"""Which exceptions are a sentence to the user, and which sentence."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from pathlib import Path

from hydra.errors import HydraException, InstantiationException
from omegaconf import DictConfig
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.folders import changed_settings

_NEXT_STEP = {
    errno.ENOSPC: "free some space, or write elsewhere with outputs_dir=DIR; ckpt_path=last"
    " continues a run",
    errno.EDQUOT: "free some of your quota, or write elsewhere with outputs_dir=DIR",
    errno.EACCES: "change its permissions, or write elsewhere with outputs_dir=DIR",
    errno.EPERM: "change its permissions, or write elsewhere with outputs_dir=DIR",
    errno.EROFS: "write elsewhere with outputs_dir=DIR",
    errno.EMFILE: "raise the limit of open files: ulimit -n 4096",
    errno.ENAMETOOLONG: "choose a shorter path, e.g. outputs_dir=DIR",
}
_OUT_OF_MEMORY = ("can't allocate memory", "CUDA out of memory", "not enough memory")


def as_sentence(error: BaseException, cfg: DictConfig | None = None) -> CospeechError | None:
    """A one-line error in the place of an exception that the user can act on.

    Args:
        error: What a command ended with.
        cfg: Its config, where it was composed.

    Returns:
        None for anything unexpected, which deserves its traceback.
    """
    chain = list(_causes(error))
    for link in chain:
        if isinstance(link, CospeechError):
            return link
    for link in chain:
        told = _of_system(link, cfg) or _of_settings(link)
        if told is not None:
            return told
    return None


def _causes(error: BaseException) -> Iterator[BaseException]:
    """The exception, and what those that only pass on were caused by.

    Those are Hydra's, OmegaConf's, and logging's where it can't open a file.
    """
    seen = set[int]()
    link: BaseException | None = error
    while link is not None and id(link) not in seen:
        seen.add(id(link))
        yield link
        passes_on = isinstance(link, HydraException | OmegaConfBaseException) or str(
            link
        ).startswith("Unable to configure handler")
        link = (link.__cause__ or link.__context__) if passes_on else None


def _of_system(error: BaseException, cfg: DictConfig | None) -> CospeechError | None:
    text = str(error)
    if isinstance(error, OSError):
        if isinstance(error, HydraException):  # a missing yaml is both
            return None
        what = error.strerror or text or type(error).__name__
        where = str(error.filename) if error.filename is not None else _outputs(cfg)
        return CospeechError(f"{where}: {what}", _NEXT_STEP.get(error.errno or 0))
    if isinstance(error, MemoryError) or any(part in text for part in _OUT_OF_MEMORY):
        return CospeechError(
            f"the memory isn't enough ({text.strip().splitlines()[0][:200] if text else 'RAM'})",
            "fewer windows at a time take less: training.batch_size=16",
        )
    if text.startswith("Error(s) in loading state_dict for"):
        return _shapes(text, cfg)
    return None


def _outputs(cfg: DictConfig | None) -> str:
    folder = None if cfg is None else cfg.get("outputs_dir")
    return "a file of this command" if folder is None else f"below outputs_dir={folder}"


def _shapes(text: str, cfg: DictConfig | None) -> ConfigError:
    """A checkpoint that another network made."""
    lines = [line.strip() for line in text.splitlines()[1:] if line.strip()]
    problem = f"its weights are of another network ({lines[0][:200] if lines else text[:200]})"
    path = None if cfg is None else cfg.get("ckpt_path")
    if cfg is None or path in (None, "last"):
        return ConfigError(problem, "take the checkpoint that these settings made")
    changed = changed_settings(cfg, Path(path).absolute().parent.parent / "record.json")
    told = f"; since that run, {'; '.join(changed)}" if changed else ""
    return ConfigError(
        f"ckpt_path={path}: {problem}{told}", "give that run's settings again, or start a new run"
    )


def _of_settings(error: BaseException) -> ConfigError | None:
    if isinstance(error, MissingMandatoryValue):
        key = str(error.full_key)
        return ConfigError(f"{key} is not set", f"add {key}=...")
    if isinstance(error, InstantiationException):
        text, _, key = str(error).partition("full_key:")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        cause = error.__cause__
        told = f"{type(cause).__name__}: {cause}" if cause is not None else lines[-1]
        return ConfigError(
            f"{key.strip() or 'a setting'}: {' '.join(told.split())[:300]}", "mend this setting"
        )
    if isinstance(error, HydraException | OmegaConfBaseException):
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        key = str(getattr(error, "full_key", None) or "")
        told = lines[0] if lines else type(error).__name__
        return ConfigError(f"{key}: {told}" if key else told, None)
    return None
