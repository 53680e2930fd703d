"""The one door to a run's folder, which may be a stranger's.

Of `record.json` and of a checkpoint only plain values are taken. The method's class is looked up
in the closed list of `cospeech.experiment.known_parts`, and gets its own arguments alone. Nothing
else is built: the corpus of a run is a store that lies prepared among the user's, found by its
fingerprint, and is never made, nor anything else written, because of what a record says.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_type_hints

import torch
from hydra.utils import get_class
from lightning import LightningModule
from torch import Tensor, nn

from cospeech.corpus.store import Store
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.experiment.known_parts import KnownPart, known_part, names_of
from cospeech.experiment.plain_arguments import (
    argument_names,
    require_arguments,
    require_known,
    require_plain,
    require_types,
)
from cospeech.foreign import understood
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import HasSchedule, NeedsStore
from cospeech.nn.checkpoints import is_kept, previous_of, read_whole
from cospeech.nn.weights_file import filled
from cospeech.quoting import setting
from cospeech.reporting.record import load_record

CHECKPOINTS = ("best", "last")
NO_CORPUS = "/dev/null/no prepared corpus"
"""A path at which nothing can lie."""

_ANOTHER_RUN = "give the folder of a finished run, e.g. outputs/runs/ID"
_NEEDED = ("id", "status", "model", "data", "ablation", "seed", "config")
JUDGING: dict[str, Any] = {
    "encoder": str,
    "encoder_epochs": int,
    "encoder_seed": int,
    "reference_seed": int,
}
"""The settings of ``metrics`` that say how is judged, and the type of each."""

_NOT_OF_THE_CORPUS = ("store_dir", "batch_size", "seed", "workers", "encoder")


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run whose record has been checked; `FinishedRun.load` makes its method.

    Attributes:
        folder: The run's folder.
        id: Its id, as `model`, `data` and `ablation` printable text.
        model: Name of the method's yaml.
        data: Name of the corpus's yaml.
        ablation: Name of the ablation.
        seed: Of the training.
        status: ``"ok"``, ``"failed"``, ``"interrupted"`` or ``"running"``.
        fingerprint: Of the corpus; None where the run stopped before it knew.
        method: The method's class.
        metrics: How it was judged, as in ``conf/metrics``; without what the record lacks.
        columns: Names of the metrics that it was judged by, lines of text each.
        experiment: Name of the experiment's yaml, if any.
        config: The record's settings of ``model``, ``data``, ``metrics`` and ``training``, as
            plain values.
        checkpoint: File of the chosen weights, or where it was if only the one before is there.
    """

    folder: Path
    id: str
    model: str
    data: str
    ablation: str
    seed: int
    status: str
    fingerprint: str | None
    method: type[LightningModule]
    metrics: dict[str, Any]
    columns: tuple[str, ...]
    experiment: str | None
    config: Mapping[str, Any]
    checkpoint: Path
    _corpus: KnownPart = field(repr=False)

    def load(self, store: Store | None = None, **given: Any) -> GestureMethod:
        """The trained method, on the CPU and ready to be asked.

        Args:
            store: The corpus, one of the user's. Without one the method has none, whatever folder
                the checkpoint names.
            given: Arguments of the constructor in the place of the checkpoint's.

        Raises:
            InputFileError: The checkpoint is damaged, or not of this run's method.
            CospeechError: The checkpoint is damaged, and the one before it too.
            ConfigError: The method makes no motion, has no such argument, or ``best`` was asked
                for and no epoch of the stage that counts is done.
        """
        if not issubclass(self.method, GestureMethod):
            raise ConfigError(
                f"run={self.folder}: a {self.model} makes no motion", "give a run of a method"
            )
        for name in given:
            if name not in argument_names(self.method):
                raise ConfigError(f"a {self.model} has no {name}", f"leave {name} out")
        hint = _instead_of(self.checkpoint)
        checkpoint, content = read_whole(self.checkpoint, hint)
        what = f"a checkpoint of model={self.model}"
        with understood(checkpoint, what, hint), _in_file(checkpoint, hint):
            model = self._built(content, store, given)
            is_far_enough = not isinstance(model, HasSchedule) or model.in_last_stage
        if self.checkpoint.stem == "best" and not is_far_enough:
            raise ConfigError(
                f"run={self.folder}: no epoch of the last stage of its training is done, and"
                " best.ckpt holds what was there before it",
                _to_its_end("checkpoint=last takes the weights as they are"),
            )
        return model

    @property
    def usual_encoder(self) -> str:
        """What is usual for judging on the run's corpus, as its yaml says, not the record."""
        return str(self._corpus.values["encoder"])

    def needs_store(self, **given: Any) -> bool:
        """Whether the method looks things up in its corpus, with these arguments of its own."""
        arguments = {**self.config["model"], **given}
        return issubclass(self.method, NeedsStore) and self.method.needs_store(arguments)

    def _built(
        self, content: dict[str, Any], store: Store | None, given: dict[str, Any]
    ) -> GestureMethod:
        arguments = dict(content["hyper_parameters"])
        require_arguments(self.method, arguments, "hyper_parameters")
        if "corpus" in arguments:
            # Never the folder that the checkpoint names, where a database would be fitted.
            folder = NO_CORPUS if store is None else str(store.path.absolute())
            arguments["corpus"] = {**arguments["corpus"], "store": folder}
        arguments |= given
        state: dict[str, Tensor] = content["state_dict"]

        def made() -> LightningModule:
            model = self.method(**arguments)
            # Before its weights are compared, as Lightning does: a method may say better than their
            # sizes why they don't fit.
            with torch.device("cpu"):
                model.on_load_checkpoint(content)
            return model

        with _not_many_more_weights_than(len(state)):
            # Of a training that diverged the motion tells.
            model = filled(made, state, finite=False)
        assert isinstance(model, GestureMethod)
        return model.eval()

    def find_store(self, folders: Iterable[str | Path]) -> Store | None:
        """The run's corpus, as it was prepared for it.

        Args:
            folders: Of stores: the user's own. Those beside the run come after them, for outputs
                that were moved.

        Returns:
            None where it isn't.

        Raises:
            InputFileError: It is there and damaged.
        """
        if self.fingerprint is None:
            return None
        # Of outputs/runs/ID and outputs/studies/NAME/ID; whose the folders above are, who knows.
        beside = (above / "stores" for above in self.folder.absolute().parents[:3])
        for folder in (*map(Path, folders), *beside):
            for manifest in sorted(folder.glob("*/manifest.json")):
                if not manifest.parent.name.endswith(f"-{self.fingerprint[:6]}"):
                    continue
                store = Store(manifest.parent)
                if store.fingerprint == self.fingerprint:
                    return store
        return None

    def require_store(self, folders: Iterable[str | Path], command: str) -> Store:
        """As `find_store`.

        Args:
            folders: Of stores.
            command: What to type to go on, e.g. ``"python evaluate.py run=DIR"``; the settings
                that make the corpus again are added.

        Raises:
            ConfigError: It isn't there.
        """
        store = self.find_store(folders)
        if store is None:
            settings, others = self._data_settings()
            typed = " ".join([setting("data", self.data), *settings])
            more = f", with {', '.join(others)} as in its record.json" if others else ""
            raise ConfigError(
                f"run={self.folder}: its prepared corpus isn't here any more"
                f" (fingerprint {(self.fingerprint or 'unknown')[:12]})",
                f"data.store_dir=DIR says where it lies; or make it again: {command} {typed}{more}",
            )
        return store

    def _data_settings(self) -> tuple[list[str], list[str]]:
        """What the corpus was made from, as far as it isn't the default, as one types it.

        After that the names of what can be said in a yaml alone.
        """
        typed, others = list[str](), list[str]()
        for name, value in self.config["data"].items():
            if name in _NOT_OF_THE_CORPUS or value == self._corpus.values.get(name):
                continue
            try:
                typed.append(setting(f"data.{name}", value))
            except ValueError:
                others.append(f"data.{name}")
        return typed, others


def load(
    run: str | Path,
    checkpoint: str = "best",
    store_folders: Iterable[str | Path] = (),
    **given: Any,
) -> GestureMethod:
    """The trained method of a finished run, on the CPU and ready to speak.

    Args:
        run: The run's folder.
        checkpoint: ``"best"`` or ``"last"``.
        store_folders: Where prepared corpora lie, for a method that looks things up in its own;
            those beside the run are looked through anyway.
        given: Arguments of the method's constructor in the place of the checkpoint's.

    Raises:
        ConfigError: As `open_run` and `FinishedRun.load`, or the corpus that the method looks
            things up in isn't there any more.
        InputFileError: As `open_run` and `FinishedRun.load`.
    """
    opened = open_run(run, checkpoint)
    store = None
    if opened.needs_store(**given):
        folders = [str(folder) for folder in store_folders]
        named = [setting("data.store_dir", folder) for folder in folders[:1]]
        store = opened.require_store(folders, " ".join(["python prepare.py", *named]))
    return opened.load(store, **given)


def open_run(folder: str | Path, checkpoint: str = "best") -> FinishedRun:
    """Open a run's folder.

    Args:
        folder: It, or its ``record.json``.
        checkpoint: ``"best"``, of a run that came to its end, or ``"last"``, of any.

    Raises:
        ConfigError: No such choice, no run there, the run hasn't come to its end, or no such
            checkpoint.
        InputFileError: The record is damaged, or says anything but plain values, names of the
            closed list and their own arguments.
    """
    if checkpoint not in CHECKPOINTS:
        raise ConfigError(f"checkpoint={checkpoint!r} is not one of {', '.join(CHECKPOINTS)}")
    folder = _folder_of(Path(folder))
    record = _inside(folder, folder / "record.json")
    values = load_record(record, needs=_NEEDED)
    with understood(record, "a run's record", _ANOTHER_RUN), _in_file(record, _ANOTHER_RUN):
        run = _checked(folder, values, checkpoint)
    if checkpoint == "best" and run.status != "ok":
        told = {"running": "still running, or was killed"}.get(run.status, run.status)
        raise ConfigError(
            f"run={folder} has not come to its end ({told}): its best checkpoint is the best so"
            " far, which may be worth nothing",
            _to_its_end("checkpoint=last takes it as it is"),
        )
    if not is_kept(run.checkpoint):
        raise ConfigError(
            f"run={folder}: no checkpoints/{checkpoint}.ckpt there", _instead_of(run.checkpoint)
        )
    return run


def _checked(folder: Path, values: dict[str, Any], checkpoint: str) -> FinishedRun:
    parts = ("model", "data", "metrics", "training", "choices")
    config = {part: dict(values["config"].get(part, {})) for part in parts}
    # What a run is judged by is the command's own; a record's classes are a stranger's.
    config["metrics"].pop("catalogue", None)
    model, data = (_part(config[group], group, values[group]) for group in ("model", "data"))
    method = get_class(model.target)
    for name, known in (("model", argument_names(method)), ("data", list(data.values))):
        require_plain(config[name], f"config.{name}")
        require_known(list(config[name]), known, f"config.{name}")
    # Data modules lie in the project's folder, and their types are known where that is at hand.
    if find_spec(data.target.partition(".")[0]) is not None:
        require_types(config["data"], get_type_hints(get_class(data.target)), "config.data")
    for part in ("metrics", "training", "choices"):
        require_plain(config[part], f"config.{part}")
    require_known(list(config["metrics"]), list(JUDGING), "config.metrics")
    require_types(config["metrics"], JUDGING, "config.metrics")
    file = folder / "checkpoints" / f"{checkpoint}.ckpt"
    _inside(folder, previous_of(file))
    return FinishedRun(
        folder=folder,
        id=values["id"],
        model=values["model"],
        data=values["data"],
        ablation=values["ablation"],
        seed=values["seed"],
        status=values["status"],
        fingerprint=values.get("data_fingerprint"),
        method=method,
        metrics=config["metrics"],
        columns=tuple(column["key"] for column in values.get("metrics", [])),
        experiment=config["choices"].get("experiment"),
        config=config,
        checkpoint=_inside(folder, file),
        _corpus=data,
    )


def _part(values: dict[str, Any], group: str, name: str) -> KnownPart:
    """Take the class's name out of the values; it has to be the one that the group's yaml names."""
    target, known = values.pop("_target_", None), known_part(group, name)
    if known is None:
        raise CospeechError(
            f"{group}={name} is not offered here",
            f"there are {', '.join(names_of(group))}; one of your own needs its yaml in"
            f" conf/{group}",
        )
    if target != known.target:
        raise CospeechError(
            f"config.{group}._target_={str(target)[:80]!r} is not {known.target}, which"
            f" {group}={name} names"
        )
    return known


@contextmanager
def _in_file(path: Path, hint: str) -> Iterator[None]:
    """Problems inside are told with the file's name."""
    try:
        yield
    except InputFileError:
        raise
    except CospeechError as error:
        raise InputFileError(path, error.problem, hint=error.hint or hint) from None


def _folder_of(path: Path) -> Path:
    if path.name == "record.json":
        path = path.parent
    if path.suffix == ".ckpt":
        raise ConfigError(
            f"run={path} is a checkpoint's file",
            "give the run's folder and name the checkpoint:"
            f" {setting('run', str(path.parent.parent))} checkpoint=best (or last)",
        )
    if not (path / "record.json").is_file():
        below = sorted(found.parent for found in path.glob("*/record.json"))
        hint = (
            f"it is a folder of runs: {setting('run', str(below[-1]))}" if below else _ANOTHER_RUN
        )
        raise ConfigError(f"run={path}: no record.json there", hint)
    return path


def _inside(folder: Path, path: Path) -> Path:
    """The path, unless it is a link out of the folder."""
    if folder.resolve() not in path.resolve().parents:
        raise InputFileError(
            path, "is a link to something outside the run's folder", hint="copy the file into it"
        )
    return path


def _instead_of(checkpoint: Path) -> str:
    other = checkpoint.with_name("last.ckpt" if checkpoint.stem == "best" else "best.ckpt")
    if other.is_file() and other.stat().st_size:
        return f"checkpoint={other.stem} takes {other.name}; or train the run again"
    return _ANOTHER_RUN


def _to_its_end(or_else: str) -> str:
    return (
        "train it to its end: the command that it was started with, and ckpt_path=last; or"
        f" {or_else}"
    )


@contextmanager
def _not_many_more_weights_than(count: int) -> Iterator[None]:
    """Stop the making of modules whose settings are of far more weights than a file has."""
    left = 1000 + 8 * count

    def one_more(*_: object) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise CospeechError(f"its settings are of far more weights than the {count} it holds")

    handles = [
        nn.modules.module.register_module_parameter_registration_hook(one_more),
        nn.modules.module.register_module_buffer_registration_hook(one_more),
    ]
    try:
        yield
    finally:
        for handle in handles:
            handle.remove()
