"""Checkpoints that neither a kill nor a full disk tears.

A checkpoint is written beside its target, flushed to the disk and renamed, so the target is the old
one or the new one. Of the checkpoint that runs continue from the one before is kept as well, and
taken where the newest turns out to be damaged.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lightning.fabric.plugins import CheckpointIO

from cospeech.errors import CospeechError, InputFileError
from cospeech.files import flush, remove_temporaries, replacing
from cospeech.nn.weights_file import read_checkpoint, save

LAST = "last.ckpt"
"""The checkpoint that runs continue from."""

_START_AGAIN = "start the run again without ckpt_path, or go on from another file: ckpt_path=FILE"

logger = logging.getLogger(__name__)


class WholeCheckpoints(CheckpointIO):
    """Writes and reads the checkpoints of Lightning's trainer."""

    def __init__(self) -> None:
        self._whole: set[Path] = set()

    def save_checkpoint(
        self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None
    ) -> None:
        """Replace a checkpoint as soon as the new one is whole on the disk.

        Raises:
            CospeechError: It can't be written; what was there is as it was.
        """
        path = _one_name(path)
        remove_temporaries(path.parent, path.name)  # one process writes a run's folder
        try:
            with replacing(path) as temporary:
                save(checkpoint, temporary)
                flush(temporary)
                # A damaged one must not take the place of the good one before it.
                if path.name == LAST and path in self._whole:
                    _keep(path, previous_of(path))
        except CospeechError as error:
            stays = "; the one before it is whole" if path.exists() else ""
            raise CospeechError(
                f"{error.problem}{stays}",
                "free some space, or mend the folder's permissions; then continue the run with"
                " ckpt_path=last",
            ) from error
        self._whole.add(path)

    def load_checkpoint(
        self,
        path: str | Path,
        map_location: Callable | None = None,
        weights_only: bool | None = None,
    ) -> dict[str, Any]:
        """A checkpoint on the CPU, or the one before where it is damaged; nothing is unpickled.

        Raises:
            InputFileError: It is damaged, and no other was kept.
            CospeechError: Both are damaged.
        """
        path = _one_name(path)
        whole, content = read_whole(path, _START_AGAIN)
        self._whole.add(whole)
        _follow(content, path.parent)
        return content

    def remove_checkpoint(self, path: str | Path) -> None:
        """Delete a checkpoint, if there is one."""
        Path(path).unlink(missing_ok=True)


def previous_of(path: Path) -> Path:
    """Where the predecessor of a checkpoint is kept: ``last.previous.ckpt`` of ``last.ckpt``."""
    return path.with_name(f"{path.stem}.previous{path.suffix}")


def is_kept(path: Path) -> bool:
    """Whether there is a checkpoint, or the one before it."""
    return path.is_file() or previous_of(path).is_file()


def read_whole(path: Path, hint: str) -> tuple[Path, dict[str, Any]]:
    """A checkpoint, or with a warning the one before where it is damaged; and the file it is from.

    Args:
        path: The checkpoint.
        hint: What to do without both.

    Raises:
        InputFileError: It is damaged, and no other was kept.
        CospeechError: Both are damaged.
    """
    previous = previous_of(path)
    faults: list[InputFileError] = []
    for candidate in (path, previous) if previous.is_file() else (path,):
        try:
            content = read_checkpoint(candidate, hint)
        except InputFileError as error:
            faults.append(error)
            continue
        if faults:
            logger.warning(
                "%s; taking the checkpoint before, %s (epoch %s, step %s)",
                faults[0].problem,
                candidate,
                content.get("epoch"),
                content.get("global_step"),
            )
        return candidate, content
    if len(faults) == 1:
        raise faults[0]
    problems = "; ".join(error.problem for error in faults)
    raise CospeechError(f"no checkpoint is whole: {problems}", hint) from faults[0]


def _one_name(path: str | Path) -> Path:
    return Path(path).parent.resolve() / Path(path).name


def _follow(content: dict[str, Any], folder: Path) -> None:
    """Have a moved checkpoint name the best one beside it.

    Lightning keeps absolute paths, and forgets the best score where they are of another folder.
    """
    states = content.get("callbacks")
    for state in states.values() if isinstance(states, dict) else ():
        before = state.get("dirpath") if isinstance(state, dict) else None
        if not isinstance(before, str) or before == str(folder):
            continue

        def moved(path: Any, before: str = before) -> Any:
            inside = isinstance(path, str) and Path(path).parent == Path(before)
            return str(folder / Path(path).name) if inside else path

        best = moved(state.get("best_model_path"))
        if not isinstance(best, str) or (best and not Path(best).is_file()):
            continue
        for key in ("best_model_path", "kth_best_model_path", "last_model_path"):
            state[key] = moved(state.get(key, ""))
        scores = state.get("best_k_models")
        if isinstance(scores, dict):
            state["best_k_models"] = {moved(path): score for path, score in scores.items()}
        state["dirpath"] = str(folder)


def _keep(path: Path, previous: Path) -> None:
    """Make a file its own predecessor, and leave it in its place where links are known."""
    link = path.with_name(f".{path.name}.link")
    link.unlink(missing_ok=True)
    try:
        os.link(path, link)
    except OSError:
        path.replace(previous)
        return
    link.replace(previous)
    link.unlink(missing_ok=True)  # a rename between two links of one file does nothing
