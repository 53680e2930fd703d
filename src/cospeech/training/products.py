"""What a stage leaves behind, in files that later runs of the same settings start from."""

from __future__ import annotations

import hashlib
import json
import logging
from pathlib import Path
from typing import Any

from torch import Tensor

from cospeech.errors import InputFileError
from cospeech.nn.weights_file import read_weights, write_weights

logger = logging.getLogger(__name__)

FORMAT = "cospeech.product"
LARGEST_BYTES = 2 * 2**30
"""A product may hold a network many times over."""

VERSION = 3
"""Counted up when a stage's code changes, as older products aren't what it would make."""


def product_key(facts: Any) -> str:
    """Hash of everything a product depends on, given as JSON values."""
    text = json.dumps([VERSION, facts], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def tensors_hash(tensors: dict[str, Tensor]) -> str:
    """Hash of names and values."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()


class Products:
    """A folder of products, ``<stage>-<key>.pt``: plain tensors and values.

    Args:
        folder: Where they are; None writes and finds nothing.
    """

    def __init__(self, folder: str | None) -> None:
        self.folder = None if folder is None else Path(folder)

    def path(self, stage: str, key: str) -> Path | None:
        """Where the product of a stage is or would be."""
        return None if self.folder is None else self.folder / f"{stage}-{key[:16]}.pt"

    def write(self, stage: str, key: str, content: dict[str, Any]) -> None:
        """Write a product; the file appears only when complete."""
        path = self.path(stage, key)
        if path is None:
            return
        values = {"format": FORMAT, "key": key, "stage": stage, "content": content}
        write_weights(path, values)
        logger.info("%s is done; its product is %s", stage, path)

    def find(self, stage: str, key: str) -> dict[str, Any] | None:
        """The content of a product; None, with a warning where it is damaged, if there is none."""
        path = self.path(stage, key)
        if path is None or not path.is_file():
            return None
        try:
            found = read_weights(path, "the stage runs again", largest_bytes=LARGEST_BYTES)
            told = (found.get("format"), found.get("key"), found.get("stage"))
            content = found.get("content")
            if told != (FORMAT, key, stage) or not isinstance(content, dict):
                raise InputFileError(path, f"not the product of {stage} that its name says")
        except InputFileError as error:
            logger.warning("%s: %s; %s is done again", path, error.problem, stage)
            return None
        logger.info("%s was done before: taken from %s", stage, path)
        return content
