"""Which exceptions are a sentence to the user, and which sentence."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path

from hydra.errors import HydraException, InstantiationException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.folders import changed_settings

_NEXT_STEP = {
    errno.ENOSPC: "free some space",
    errno.EDQUOT: "free some of your quota",
    errno.EACCES: "change its permissions",
    errno.EPERM: "change its permissions",
    errno.EMFILE: "raise the limit of open files: ulimit -n shows it, ulimit -n NUMBER sets it",
    errno.ENAMETOOLONG: "choose a shorter path",
}
_OF_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
_OF_A_PLACE = (*_OF_WRITING, errno.EACCES, errno.EPERM, errno.ENAMETOOLONG)
_OF_NO_FOLDER = (errno.ENOTDIR, errno.EEXIST)
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
    # What a setting's object met is closer than that it can't be made.
    told = (_of_system(link, cfg) for link in reversed(chain))
    return next(filter(None, [*told, *map(_of_settings, chain)]), None)


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
        if error.errno in _OF_NO_FOLDER and (file := _file_on_the_way(error)) is not None:
            place = _setting_of(_path(error), cfg)
            elsewhere = None if place is None else f"give another folder: {place}=DIR"
            return CospeechError(f"{file} is a file, not a folder", elsewhere)
        what = error.strerror or text or type(error).__name__
        where = str(error.filename) if error.filename is not None else _outputs(cfg)
        return CospeechError(f"{where}: {what}", _next_step(error, cfg))
    if isinstance(error, MemoryError) or any(part in text for part in _OUT_OF_MEMORY):
        return CospeechError(
            f"the memory isn't enough ({text.strip().splitlines()[0][:200] if text else 'RAM'})",
            _less_memory(cfg),
        )
    if text.startswith("Error(s) in loading state_dict for"):
        return _shapes(text, cfg)
    return None


def _next_step(error: OSError, cfg: DictConfig | None) -> str | None:
    number = error.errno or 0
    steps = [_NEXT_STEP[number]] if number in _NEXT_STEP else []
    if number == errno.ENOSPC and cfg is not None and "ckpt_path" in cfg:
        steps[0] += ", and go on with ckpt_path=last"
    if number in _OF_A_PLACE and (elsewhere := _place(error, cfg)):
        steps.append(f"write elsewhere with {elsewhere}=DIR")
    return ", or ".join(steps) or None


def _place(error: OSError, cfg: DictConfig | None) -> str | None:
    """The setting that says where what can't be written goes; None for anything else."""
    if cfg is None or not isinstance(error.filename, str | bytes):
        return "outputs_dir" if error.errno in _OF_WRITING else None
    path = _path(error)
    if error.errno not in _OF_WRITING and os.access(path, os.F_OK):
        return None  # it is there, perhaps to be read
    return _setting_of(path, cfg)


def _path(error: OSError) -> Path:
    return Path(os.fsdecode(error.filename)).absolute()


def _file_on_the_way(error: OSError) -> Path | None:
    """The file that lies where an error's path needs a folder."""
    if not isinstance(error.filename, str | bytes):
        return None
    path = _path(error)
    on_the_way = (one for one in (path, *path.parents) if one.exists())
    return next((one for one in on_the_way if not one.is_dir()), None)


def _setting_of(path: Path, cfg: DictConfig | None) -> str | None:
    """The setting below whose folder a path lies."""
    if cfg is None:
        return None
    for name in ("outputs_dir", "data.store_dir"):
        folder = OmegaConf.select(cfg, name)
        if folder is not None and path.is_relative_to(Path(folder).absolute()):
            return name
    return None


def _less_memory(cfg: DictConfig | None) -> str | None:
    """What takes less memory in the command that the config is of."""
    if cfg is None or "run" in cfg or "training" not in cfg:  # a finished run has its sizes
        return None
    if "ckpt_path" not in cfg:  # preparing
        return None if cfg.data.workers == 1 else "fewer processes take less: data.workers=1"
    less = cfg.training.batch_size // 2
    return f"fewer windows at a time take less: training.batch_size={less}" if less else None


def _outputs(cfg: DictConfig | None) -> str:
    folder = None if cfg is None else cfg.get("outputs_dir")
    return "a file of this command" if folder is None else f"below outputs_dir={folder}"


def _shapes(text: str, cfg: DictConfig | None) -> ConfigError:
    """A checkpoint that another network made."""
    lines = [line.strip() for line in text.splitlines()[1:] if line.strip()]
    problem = f"its weights are of another network ({lines[0][:200] if lines else text[:200]})"
    path = None if cfg is None else cfg.get("ckpt_path")
    if cfg is None or path is None:
        return ConfigError(problem)
    if path == "last":
        return ConfigError(f"ckpt_path=last: {problem}", "leave ckpt_path out for a new run")
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
        told = f"{type(cause).__name__}: {cause}" if cause is not None else " ".join(lines)
        lacks = isinstance(cause, ImportError)
        return ConfigError(
            f"{key.strip() or 'a setting'}: {' '.join(told.split())[:300]}",
            "install what it needs, or choose another" if lacks else "mend this setting",
        )
    if isinstance(error, HydraException | OmegaConfBaseException):
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        key = str(getattr(error, "full_key", None) or "")
        told = lines[0] if lines else type(error).__name__
        return ConfigError(f"{key}: {told}" if key else told, None)
    return None
