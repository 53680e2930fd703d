"""The door for files that strangers wrote: bounded bytes, plain values, documented errors.

Nothing here runs or instantiates what a file says. Readers take their bytes and values from here,
and do the rest inside `understood`, so that whatever a file makes of them, only a `CospeechError`
that names the file comes out.
"""

from __future__ import annotations

import json
import logging
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import re2
import yaml

from cospeech.errors import ContentError, CospeechError, InputFileError

if TYPE_CHECKING:
    from numpy.typing import NDArray

T = TypeVar("T")

MOST_JSON_BYTES = 32 * 2**20
"""Python's objects take up to some 25 times the bytes of their JSON."""

MOST_JSON_CONTAINERS = 500_000
"""Brackets and braces that open, in texts too: empty lists take fifty times their bytes."""

MOST_YAML_BYTES = 2**18
MOST_YAML_TOKENS = 20_000
"""Each takes some 30 to 60 microseconds to read."""

MOST_DIGITS = 30
"""No number that a file of ours or of a user's needs is longer; Python's integers have no end."""

DEEPEST_YAML = 20
MOST_DOCUMENTS = 100_000
"""One after another in a stream of JSON."""

_log = logging.getLogger(__name__)
_LONG_NUMBER = re.compile(rf"[0-9]{{{MOST_DIGITS + 1}}}")
_NOT_BLANK = re.compile(r"\S")
_SURROGATE_ESCAPE = re.compile(r"\\u[dD][89a-fA-F]")
_LONE_SURROGATE = re.compile("[\ud800-\udfff]")
_ESCAPE_OR_BRACKET = re.compile(r"\\.|\[:\^?[a-z]+:\]|\[\^?\]?|\]", re.DOTALL)
_CLASSES = {
    r"\w": r"\p{L}\p{M}\p{N}_",
    r"\W": r"\p{Pd}\p{Ps}\p{Pe}\p{Pi}\p{Pf}\p{Po}\p{S}\p{Z}\p{C}",
    r"\d": r"\p{Nd}",
    r"\D": r"\P{Nd}",
}


@contextmanager
def understood(path: str | Path, what: str, hint: str | None = None) -> Iterator[None]:
    """Turn whatever goes wrong inside, while a file is read, into an error about that file.

    Args:
        path: The file.
        what: What it should be, with its article: ``"a joint map"``.
        hint: What to do without it.

    Raises:
        InputFileError: A `ContentError` was raised inside, or anything but a `CospeechError`; other
            ones of those come out as they are.
    """
    try:
        yield
    except ContentError as error:
        raise InputFileError(path, error.problem, error.place, error.hint) from error.__cause__
    except CospeechError:
        raise
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        raise InputFileError(path, f"can't be read as {what} ({reason})", hint=hint) from error
    except (MemoryError, RecursionError) as error:
        problem = f"is too large or too deep for {what}"
        raise InputFileError(path, problem, hint=hint) from error
    except Exception as error:
        _log.debug("%s is not %s", path, what, exc_info=True)
        reason = str(error).strip().split("\n", 1)[0][:200]
        told = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
        raise InputFileError(path, f"is damaged, or not {what} ({told})", hint=hint) from error


def require_no_pipe(path: Path) -> None:
    """Refuse what would never end, or keep its reader waiting: pipes, devices, folders.

    For readers that open their file themselves; others take `open_file`.

    Raises:
        InputFileError: It is one of these. A file that is absent is left to its reader.
    """
    if path.exists() and not path.is_file():
        raise _no_file(path, None)


def open_file(path: str | Path, hint: str | None = None) -> BufferedReader:
    """A file to read from, opened without waiting for anyone.

    Raises:
        InputFileError: It is a pipe, a device or a folder.
        OSError: It is absent or can't be read.
    """
    try:
        file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115
    except IsADirectoryError:
        raise _no_file(path, hint) from None
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise _no_file(path, hint)
    return file


def _without_waiting(path: str, flags: int) -> int:
    # A pipe that nobody writes to is opened only when somebody does.
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _no_file(path: str | Path, hint: str | None) -> InputFileError:
    return InputFileError(path, "can't be read: it is not a file", hint=hint)


def read_bytes(path: str | Path, what: str, most_bytes: int, hint: str | None = None) -> bytes:
    """A whole file, refused when it is longer than anything of its kind is.

    Args:
        path: The file.
        what: What it should be, with its article.
        most_bytes: Its greatest length.
        hint: What to do without it.

    Raises:
        InputFileError: Absent, unreadable, no regular file, or too long.
    """
    with understood(path, what, hint), open_file(path, hint) as file:
        # `read` takes memory for as much as it is asked for.
        data = file.read(min(os.fstat(file.fileno()).st_size, most_bytes) + 1)
    if len(data) > most_bytes:
        problem = f"too long for {what} (over {most_bytes} bytes)"
        raise InputFileError(path, problem, hint=hint)
    return data


def open_array(path: Path, what: str, hint: str | None = None) -> NDArray[Any]:
    """An array that ``numpy.save`` wrote, by memory map.

    Raises:
        InputFileError: Absent, no regular file, of Python's objects, or not as its header says.
    """
    import numpy as np  # by a command line that has a typo it is not waited for

    with understood(path, what, hint), open_file(path, hint) as file:
        # Later versions are for headers of more than 64 KB, and claim their length unchecked.
        if np.lib.format.read_magic(file) != (1, 0):
            raise InputFileError(path, f"is not {what}: its header is no array's", hint=hint)
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
        order: Literal["F", "C"] = "F" if is_fortran else "C"
        if dtype.hasobject:
            raise InputFileError(path, f"is not {what}: it holds Python's objects", hint=hint)
        return np.memmap(file, dtype, "r", file.tell(), shape, order)


def read_json(
    path: str | Path, what: str, most_bytes: int = MOST_JSON_BYTES, hint: str | None = None
) -> Any:
    """The values of a JSON file; see `parse_json`.

    Raises:
        InputFileError: As `read_bytes`, and `parse_json`.
    """
    data = read_bytes(path, what, most_bytes, hint)
    with understood(path, what, hint):
        text = data.decode("utf-8-sig")
    return parse_json(path, text, what, hint)


def parse_json(
    path: str | Path,
    text: str,
    what: str,
    hint: str | None = None,
    most_containers: int = MOST_JSON_CONTAINERS,
) -> Any:
    """The values of a JSON text.

    Half a surrogate pair, which no file can be written with, becomes U+FFFD.

    Raises:
        InputFileError: No JSON, too much of it, nested too deep, or a number of more than
            `MOST_DIGITS` digits.
    """
    with understood(path, what, hint):
        return _decoded(text, what, hint, most_containers, lambda decoder: decoder.decode(text))


def parse_json_stream(text: str, what: str, hint: str | None = None) -> list[Any]:
    """The values of JSON documents that were written one after another.

    Raises:
        ContentError: As `parse_json`, or more than `MOST_DOCUMENTS`.
    """

    def every(decoder: json.JSONDecoder) -> list[Any]:
        documents: list[Any] = []
        place = _NOT_BLANK.search(text)
        while place is not None:
            if len(documents) == MOST_DOCUMENTS:
                raise ContentError(f"holds more than {MOST_DOCUMENTS} JSON documents", hint=hint)
            document, end = decoder.raw_decode(text, place.start())
            documents.append(document)
            place = _NOT_BLANK.search(text, end)
        return documents

    return _decoded(text, what, hint, MOST_JSON_CONTAINERS, every)


def _decoded(
    text: str, what: str, hint: str | None, most: int, decode: Callable[[json.JSONDecoder], T]
) -> T:
    if text.count("[") + text.count("{") > most:
        raise ContentError(f"too large for {what} (over {most} lists and objects)", hint=hint)
    try:
        # A function of ours per integer is slow, and hardly a file has a long one.
        values = decode(json.JSONDecoder(parse_int=_integer if _LONG_NUMBER.search(text) else None))
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise ContentError(f"is not valid JSON ({error.msg})", place, hint) from error
    except (RecursionError, ValueError) as error:
        problem = f"is not {what}: nested too deep, or a number too long ({error})"
        raise ContentError(problem, hint=hint) from error
    return _without_surrogates(values) if _SURROGATE_ESCAPE.search(text) else values


def read_yaml(
    path: str | Path, what: str, most_bytes: int = MOST_YAML_BYTES, hint: str | None = None
) -> Any:
    """The values of a yaml file; see `parse_yaml`.

    Raises:
        InputFileError: As `read_bytes`, and `parse_yaml`.
    """
    data = read_bytes(path, what, most_bytes, hint)
    with understood(path, what, hint):
        text = data.decode("utf-8-sig")
    return parse_yaml(path, text, what, hint)


def parse_yaml(path: str | Path, text: str, what: str, hint: str | None = None) -> Any:
    """The values of a yaml text: mappings, lists, texts, numbers, booleans and nulls.

    Dates, which nothing here takes, are refused, and aliases, of which a few can stand for billions
    of entries.

    Raises:
        InputFileError: No yaml, with aliases, tags or dates, too much of it, nested too deep, or a
            number of more than `MOST_DIGITS` digits.
    """
    try:
        _require_plain(path, text, hint)
        values = yaml.load(text, _PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError, OverflowError) as error:
        raise InputFileError(path, f"not valid yaml: {error}", hint=hint) from None
    if _has_long_number(values):
        problem = f"holds a number of more than {MOST_DIGITS} digits"
        raise InputFileError(path, problem, hint=hint)
    return values


class LinearPattern:
    """A regular expression whose search takes time in proportion to the text; `linear_pattern`.

    Attributes:
        groups: How many groups it has.
        groupindex: Name of a group -> its number.
    """

    def __init__(self, compiled: Any) -> None:
        self._compiled = compiled
        self.groups: int = compiled.groups
        self.groupindex: Mapping[str, int] = compiled.groupindex

    def search(self, text: str) -> Any:
        """A match as of `re`, or None; what no file can be written with is searched as ``?``."""
        return self._compiled.search(_encodable(text))

    def fullmatch(self, text: str) -> Any:
        """As `search`, of the whole text."""
        return self._compiled.fullmatch(_encodable(text))


def linear_pattern(text: str, ignore_case: bool = False) -> LinearPattern:
    r"""A regular expression whose search takes time in proportion to the text, whatever it says.

    It is RE2's, without look-around and references back to a group; ``\w`` and ``\d`` are of every
    alphabet.

    Raises:
        CospeechError: It is no such expression.
    """
    options = re2.Options()
    options.log_errors = False
    options.case_sensitive = not ignore_case
    try:
        return LinearPattern(re2.compile(_in_every_alphabet(text), options))
    except (re2.error, ValueError, OverflowError, UnicodeError) as error:
        reason = error.args[0] if error.args else error
        told = reason.decode("utf-8", "replace") if isinstance(reason, bytes) else str(reason)
        raise CospeechError(
            f"{text[:200]!r} is no regular expression that is taken here: {told[:200]}",
            "look-around ((?=...), (?<!...)) and references (\\1) are not known",
        ) from None


def _encodable(text: str) -> str:
    """The text with ``?`` for half a surrogate pair, as in a file name that is not UTF-8."""
    return text.encode("utf-8", "replace").decode()


def _in_every_alphabet(pattern: str) -> str:
    r"""The pattern with ``\w`` and ``\d`` spelt out, which are a to z and 0 to 9 alone in RE2."""
    inside = False

    def spelled(found: re.Match[str]) -> str:
        nonlocal inside
        sign = found.group()
        if sign in _CLASSES:
            return _CLASSES[sign] if inside else f"[{_CLASSES[sign]}]"
        if sign == "]":
            inside = False
        elif sign[0] == "[" and not sign.startswith("[:"):
            inside = True
        return sign

    return _ESCAPE_OR_BRACKET.sub(spelled, pattern)


class _PlainLoader(yaml.SafeLoader):
    """yaml without dates and merge keys."""


_LEFT_OUT = ("merge", "value")
_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, regex) for tag, regex in resolvers if tag.rpartition(":")[2] not in _LEFT_OUT]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def _refuse_date(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> None:
    problem = f"{node.value[:40]} is a date: put it in quotes where a text is meant"
    raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


_PlainLoader.add_constructor("tag:yaml.org,2002:timestamp", _refuse_date)

_OPENING = (
    yaml.FlowSequenceStartToken,
    yaml.FlowMappingStartToken,
    yaml.BlockSequenceStartToken,
    yaml.BlockMappingStartToken,
)
_CLOSING = (yaml.FlowSequenceEndToken, yaml.FlowMappingEndToken, yaml.BlockEndToken)


def _require_plain(path: str | Path, text: str, hint: str | None) -> None:
    depth = 0
    for count, token in enumerate(yaml.scan(text)):
        if count == MOST_YAML_TOKENS:
            raise InputFileError(path, f"has more than {MOST_YAML_TOKENS} parts of yaml", hint=hint)
        depth += isinstance(token, _OPENING) - isinstance(token, _CLOSING)
        place = f"line {token.start_mark.line + 1}"
        if isinstance(token, yaml.AliasToken):
            raise InputFileError(path, "has yaml aliases (*name)", place, "write them out")
        if isinstance(token, yaml.TagToken):
            raise InputFileError(path, "has a yaml tag (!name)", place, "leave it out")
        if depth > DEEPEST_YAML:
            raise InputFileError(path, f"nested more than {DEEPEST_YAML} deep", place, hint)


def _integer(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"{digits[:10]}... has {len(digits)} digits")
    return int(digits)


def _has_long_number(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_has_long_number(item) for pair in value.items() for item in pair)
    if isinstance(value, list | tuple):
        return any(_has_long_number(item) for item in value)
    return isinstance(value, int) and abs(value) >= 10**MOST_DIGITS


def _without_surrogates(value: Any) -> Any:
    if isinstance(value, str):
        return _LONE_SURROGATE.sub("\ufffd", value)
    if isinstance(value, list):
        return [_without_surrogates(item) for item in value]
    if isinstance(value, dict):
        return {_without_surrogates(key): _without_surrogates(v) for key, v in value.items()}
    return value
