"""Files of tensors and plain values: the one place that opens what `torch.save` wrote."""

from __future__ import annotations

import io
import warnings
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from cospeech.errors import InputFileError
from cospeech.files import replacing
from cospeech.foreign import open_file, read_bytes, understood
from cospeech.nn.pickle_opcodes import Claim, Walk

LARGEST_FILE_BYTES = 256 * 2**20
LARGEST_CHECKPOINT_BYTES = 8 * 2**30
DEEPEST = 30
"""No file of ours nests its values deeper."""

MOST_SHARING = 4
"""Tensors may share storage, as tied weights do: their sizes add up to this many times the file's
bytes at most."""

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # that typed storages, which every file names, are deprecated
    _ITEM_BYTES = {
        f"{kind.__module__}.{kind.__name__}": dtype.itemsize
        for kind in torch._storage_classes
        if isinstance(dtype := getattr(kind, "dtype", None), torch.dtype)
    } | {"torch.storage.UntypedStorage": 1}
"""Of the storages that a file may have, by name."""

_KNOWN = {
    "collections.OrderedDict",
    "torch.Size",
    "torch._utils._rebuild_parameter",
    "torch._utils._rebuild_tensor",
    "torch._utils._rebuild_tensor_v2",
    *(f"{kind.__module__}.{kind.__name__}" for kind in torch._storage_classes),
}
"""What pickled tensors and plain values refer to; torch's own list is longer."""

_PLAIN = (bool, int, float, str, bytes, type(None))

Network = TypeVar("Network", bound=nn.Module)


def write_weights(path: str | Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values; the file appears only when complete.

    Args:
        path: File to write; an existing one is replaced.
        content: What `read_weights` gives back.

    Raises:
        CospeechError: It can't be written; what was there is as it was.
    """
    with replacing(path) as temporary:
        save(content, temporary)


def save(content: dict[str, Any], path: Path) -> None:
    """`torch.save`, whose error is the system's where that is its reason.

    Raises:
        OSError: The file can't be written.
    """
    with path.open("wb") as file:
        try:
            torch.save(content, file)
        except RuntimeError as error:  # which torch's writer makes of it
            reason: BaseException | None = error
            while reason is not None and not isinstance(reason, OSError):
                reason = reason.__context__
            raise reason or error from None


class StandIn:
    """Stands for an object of a class that isn't known, or for a call: keeps what it was given.

    Attributes:
        arguments: Of the call, in order, classes apart.
        state: What the object would have held; None where the file has none.
    """

    def __new__(cls, *arguments: Any, **named: Any) -> StandIn:
        """Ignore whatever the pickle passes."""
        return super().__new__(cls)

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments = [value for value in arguments if not isinstance(value, type)]
        self.state: Any = None

    def __setstate__(self, state: Any) -> None:
        self.state = state


def read_weights(
    path: str | Path,
    hint: str,
    *,
    kind: str = "weights",
    largest_bytes: int = LARGEST_FILE_BYTES,
    allowed: Sequence[type] = (),
    stand_in: bool = False,
    dictionaries: Collection[str] = (),
) -> dict[str, Any]:
    """Read what `write_weights` or `torch.save` wrote, on the CPU; nothing that it names runs.

    Time and memory are bounded, whatever the file claims. Checksums are compared, so that a
    changed byte is found.

    Args:
        path: The file.
        hint: What to do without it.
        kind: What the file should hold, in a word, for the messages.
        largest_bytes: Larger files are refused.
        allowed: Classes that may occur besides tensors and plain values; their attributes are to
            be plain too.
        stand_in: Put a `StandIn` in the place of any other class or function, of which nothing
            runs; else files that name one are refused.
        dictionaries: Names of subclasses of `dict`, which are read as ordered dictionaries.

    Raises:
        InputFileError: Missing, too large, damaged, unsafe to read, or no dictionary.
    """
    path = Path(path)
    if not path.is_file():
        raise InputFileError(path, f"no such {kind} file", hint=hint)
    article = "an" if kind[0] in "aeiou" else "a"
    with understood(path, f"{article} {kind} file that can be read safely", hint):
        size = path.stat().st_size
        if not size:
            raise InputFileError(path, "is empty", hint=hint)
        if size > largest_bytes:
            raise InputFileError(path, f"{size / 2**20:.0f} MiB is too large", hint=hint)
        zipped = _is_zip(path)
        # Bytes, as reading from a file takes memory for as much as is asked for.
        file = path if zipped else io.BytesIO(read_bytes(path, kind, largest_bytes))
        classes: list[Any] = list(allowed)
        names = {f"{one.__module__}.{one.__qualname__}" for one in allowed}
        unknown = sorted(_names_in(file, dictionaries) - _KNOWN - names - set(dictionaries))
        if stand_in:
            # What torch knows it would not replace.
            refused = [name for name in unknown if name.startswith(("torch.", "builtins."))]
            classes += [(StandIn, name) for name in unknown]
        else:
            refused = unknown
        classes += [(OrderedDict, name) for name in dictionaries]
        if refused:
            raise ValueError(f"it names {refused[0][:100]!r}, which has no place in {kind}")
        with torch.serialization.safe_globals(classes):
            if isinstance(file, io.BytesIO):
                file.seek(0)
            # Mapped, no storage reaches past the file's end.
            content = torch.load(file, map_location="cpu", weights_only=True, mmap=zipped)
        if not isinstance(content, dict):
            problem = f"holds a {type(content).__name__}, not a dictionary of {kind}"
            raise InputFileError(path, problem, hint=hint)
        objects = (*allowed, *((StandIn,) if stand_in else ()))
        _require_bounded(content, size, objects)
        copied: dict[str, Any] = _copied(content)
    return copied


def read_checkpoint(path: str | Path, hint: str) -> dict[str, Any]:
    """The dictionary in a checkpoint that a training run wrote (``.ckpt``), on the CPU.

    As `read_weights`, for files of up to 8 GiB: tensors and plain values come back, whose memory
    is no part of the file.

    Args:
        path: The file.
        hint: What to do without it.

    Raises:
        InputFileError: Missing, empty, cut, damaged in any byte, unsafe to read, or no checkpoint.
    """
    content = read_weights(path, hint, kind="checkpoint", largest_bytes=LARGEST_CHECKPOINT_BYTES)
    if not isinstance(content.get("state_dict"), dict):
        raise InputFileError(path, "is no checkpoint: it has no state_dict", hint=hint)
    return content


def filled(
    make: Callable[[], Network], state: Mapping[str, Tensor], *, finite: bool = True
) -> Network:
    """A network with the weights of a file, made only once it is known to be of their size.

    Args:
        make: Makes the untrained network, whose sizes may be a file's claim.
        state: Its weights.
        finite: Refuse values that are not.

    Raises:
        ValueError: They are no weights of such a network, or not finite.
    """
    with torch.device("meta"):  # takes no memory
        expected = make().state_dict()
    for name, tensor in expected.items():
        found = state.get(name)
        if not isinstance(found, Tensor):
            raise ValueError(f"there is no tensor {name}")
        if found.shape != tensor.shape:
            raise ValueError(f"{name} is {list(found.shape)}, not {list(tensor.shape)}")
        if found.is_complex() or (tensor.is_floating_point() and not found.is_floating_point()):
            raise ValueError(f"{name} holds {found.dtype}, not {tensor.dtype}")
        # A double may be finite where a single is not.
        if finite and not found.to(tensor.dtype).isfinite().all():
            raise ValueError(f"{name} holds values that are not finite")
    if more := [name for name in state if name not in expected]:
        raise ValueError(f"there is no place for {more[0]!r:.100}")
    network = make()
    network.load_state_dict(dict(state))
    return network


def _is_zip(path: Path) -> bool:
    with open_file(path) as file:
        return file.read(4) == b"PK\x03\x04"


def _names_in(file: Path | io.BytesIO, dictionaries: Collection[str]) -> set[str]:
    """Classes and functions that a file refers to.

    Before torch 1.6 these were bare bytes: a magic number, a protocol, facts of the system, the
    values and the keys of storages, each a pickle.

    Raises:
        ValueError: It isn't whole, claims more than it has, or takes far more to load.
    """
    if isinstance(file, Path):
        return _zipped_names(file, dictionaries)
    size = len(file.getbuffer())
    walks = [Walk(file, dictionaries) for _ in range(5)]
    claims = {claim.key: claim for walk in walks for claim in walk.claims}
    if sum(map(_claimed_bytes, claims.values())) > size:
        raise ValueError(f"its tensors claim more than the {size} bytes that it has")
    return set().union(*(walk.names for walk in walks))


def _zipped_names(path: Path, dictionaries: Collection[str]) -> set[str]:
    """Names of a zip file, whose parts are whole and as long as told.

    Raises:
        ValueError: They are not.
    """
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        # torch tells no capitals apart.
        sizes = {entry.filename.lower(): entry.file_size for entry in entries}
        # torch never compresses, and entries may lie over one another.
        if sum(entry.file_size for entry in entries) > path.stat().st_size:
            raise ValueError("it unpacks to more than its size")
        if len(sizes) < len(entries):
            raise ValueError("two of its parts have the same name")
        if (damaged := archive.testzip()) is not None:
            raise ValueError(f"the checksum of its part {damaged[:100]!r} is wrong")
        pickles = [entry.filename for entry in entries if entry.filename.endswith("data.pkl")]
        if len(pickles) != 1:
            raise ValueError(f"{len(pickles)} parts are called data.pkl")
        # As torch's own reader finds it, which may read a zip's directory in another way.
        walk = Walk(
            io.BytesIO(torch._C.PyTorchFileReader(str(path)).get_record("data.pkl")), dictionaries
        )
    for claim in walk.claims:
        part = sizes.get(f"{pickles[0].removesuffix('.pkl')}/{claim.key}".lower(), 0)
        if _claimed_bytes(claim) > part:
            raise ValueError(f"its tensors claim more than the {part} bytes of a part")
    return walk.names


def _claimed_bytes(claim: Claim) -> int:
    if claim.kind not in _ITEM_BYTES or claim.numbers < 0:
        raise ValueError(f"it has a storage of an unusual kind ({claim.kind[:60]})")
    return claim.numbers * _ITEM_BYTES[claim.kind]


def _require_bounded(content: Any, size: int, objects: tuple[type, ...]) -> None:
    """Refuse values that are larger than their file: views, and what refers to itself.

    Raises:
        ValueError: They are, or aren't plain.
    """
    claimed, count = 0, 0
    waiting = [(content, 0)]
    while waiting:
        value, depth = waiting.pop()
        count += 1
        if count > MOST_SHARING * size or depth > DEEPEST:
            raise ValueError("its values are nested too deep or refer to one another")
        if isinstance(value, Tensor):
            plain = type(value) in (Tensor, nn.Parameter) and value.layout == torch.strided
            if not plain or value.device.type != "cpu" or value.is_quantized:
                raise ValueError("it holds a tensor of an unusual kind")
            claimed += value.numel() * value.itemsize
            if claimed > MOST_SHARING * size:
                raise ValueError(f"its tensors claim more than the {size} bytes that it has")
        elif isinstance(value, _PLAIN):
            continue
        else:
            if hasattr(value, "__dict__") and not isinstance(value, list | tuple):
                waiting.append((vars(value), depth + 1))
            waiting.extend((inner, depth + 1) for inner in _inner(value, objects))


def _inner(value: Any, objects: tuple[type, ...]) -> list[Any]:
    if isinstance(value, dict):
        return [*value.keys(), *value.values()]
    if isinstance(value, list | tuple):
        return list(value)
    if isinstance(value, objects):
        return []
    raise ValueError(f"it holds a {type(value).__name__}")


def _copied(value: Any) -> Any:
    """Without the file under its tensors."""
    if isinstance(value, Tensor):
        return value.detach().clone()
    if isinstance(value, dict):
        for key in value:
            value[key] = _copied(value[key])
    elif isinstance(value, list):
        value[:] = [_copied(inner) for inner in value]
    elif type(value) is tuple:
        return tuple(_copied(inner) for inner in value)
    elif not isinstance(value, _PLAIN) and hasattr(value, "__dict__"):
        _copied(vars(value))
    return value
