"""Settings as they are to be typed: values in Hydra's grammar, arguments in the shell's."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from typing import Any

_NEEDS_NO_QUOTES = re.compile(r"(?:\.{0,2}/|[A-Za-z_])[\w./-]*", re.ASCII)
_KEY = re.compile(r"[A-Za-z_]\w*(?: \w+)*|[?*@%|+-]+", re.ASCII)
"""Keys of a mapping, which can't be quoted."""
_NO_TEXTS = ("null", "true", "false", "inf", "nan")


def setting(name: str, value: Any) -> str:
    """``name=value``, as to be typed in a shell.

    Raises:
        ValueError: As `quoted`.
    """
    return shlex.quote(f"{name}={quoted(value)}")


def quoted(value: Any) -> str:
    """A text, number, truth, null, list or mapping in Hydra's grammar, as one value.

    Raises:
        ValueError: A key of a mapping has letters that Hydra takes in no key.
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(quoted, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_key(key)}: {quoted(item)}' for key, item in value.items())}}}"
    return _text(value) if isinstance(value, str) else str(value)


def _key(text: Any) -> str:
    if _KEY.fullmatch(str(text)) is None or str(text).lower() in _NO_TEXTS:
        raise ValueError(f"{text!r} can't be typed as a key")
    return str(text)


def _text(text: str) -> str:
    """In double quotes, where it needs them.

    There, Hydra drops a backslash before a quote and halves those before it; OmegaConf takes
    ``${`` for a reference unless a backslash is before it.
    """
    if _NEEDS_NO_QUOTES.fullmatch(text) and text.lower() not in _NO_TEXTS:
        return text
    told = list[str]()
    backslashes = 0
    for index, letter in enumerate(text):
        if letter == "\\":
            backslashes += 1
            continue
        reference = text.startswith("${", index)
        told.append("\\" * (2 * backslashes if letter == '"' or reference else backslashes))
        told.append("\\" if letter == '"' or reference else "")
        told.append(letter)
        backslashes = 0
    told.append("\\" * (2 * backslashes))
    return f'"{"".join(told)}"'
