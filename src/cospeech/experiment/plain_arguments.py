"""Values of a foreign file as arguments: plain, known by name, and of the declared type."""

from __future__ import annotations

import inspect
import types
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict

from cospeech.errors import CospeechError

_PLAIN = (bool, int, float, str, type(None))
_LONGEST_SHOWN = 60


def require_plain(value: Any, where: str) -> None:
    """Nothing but mappings, lists, texts, numbers, booleans and nulls, without instructions.

    Args:
        value: What a file says.
        where: Its place, for the messages.

    Raises:
        CospeechError: Another type, an interpolation, or a key that begins with an underscore,
            as those do that Hydra obeys (``_target_``, ``_partial_``, ``_args_``).
    """
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not isinstance(key, str) or key.startswith("_") or "${" in key:
                raise CospeechError(f"{where} has the key {_shown(key)}, which is no setting")
            require_plain(item, f"{where}.{key if key.isidentifier() else _shown(key)}")
    elif isinstance(value, list | tuple):
        for place, item in enumerate(value):
            require_plain(item, f"{where}[{place}]")
    elif not isinstance(value, _PLAIN):
        raise CospeechError(f"{where} is of type {type(value).__name__}, which is no plain value")
    elif isinstance(value, str) and "${" in value:
        raise CospeechError(f"{where}={_shown(value)} is an interpolation, which isn't followed")


def require_known(names: Sequence[str], known: Sequence[str], where: str) -> None:
    """Refuse what isn't an argument.

    Raises:
        CospeechError: The message names the unknown ones and all that are known.
    """
    if unknown := sorted(set(names) - set(known)):
        told = ", ".join(map(_shown, unknown[:5]))
        raise CospeechError(f"{where} has no {told}; there are {', '.join(sorted(known))}")


def argument_names(kind: type) -> list[str]:
    """The constructor's own arguments."""
    return [name for name in inspect.signature(kind).parameters if name != "self"]


def require_types(values: Mapping[str, Any], hints: Mapping[str, Any], where: str) -> None:
    """Each value is of the type that is declared for its name.

    Args:
        values: Plain values by name.
        hints: Types by name, as `typing.get_type_hints` gives them.
        where: Their place, for the messages.

    Raises:
        CospeechError: One isn't; the message names it and the declared type.
    """
    for name, value in values.items():
        if name in hints and not fits(value, hints[name]):
            wanted = getattr(hints[name], "__name__", None) or str(hints[name])
            if get_args(hints[name]):
                wanted = str(hints[name]).replace("typing.", "")
            raise CospeechError(f"{where}.{name}={_shown(value)} is not {wanted}")


def require_arguments(kind: type, values: Mapping[str, Any], where: str) -> None:
    """Values that a constructor may be called with.

    Raises:
        CospeechError: As `require_plain`, `require_known` and `require_types`.
    """
    require_plain(values, where)
    require_known(list(values), argument_names(kind), where)
    require_types(values, get_type_hints(kind.__init__), where)  # type: ignore[misc]


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of a declared type; a whole number is a number too."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if hint in (None, type(None)):
        return value is None
    if origin in (Union, types.UnionType):
        return any(fits(value, argument) for argument in arguments)
    if origin is Literal:
        # Which texts are among the choices is the constructor's to say, and it does so better.
        return any(type(value) is type(choice) for choice in arguments)
    if is_typeddict(hint):
        hints = get_type_hints(hint)
        return isinstance(value, Mapping) and all(
            fits(value[name], wanted) if name in value else name not in hint.__required_keys__
            for name, wanted in hints.items()
        )
    if origin is tuple:
        if not isinstance(value, list | tuple):
            return False
        if arguments[-1] is Ellipsis:
            return all(fits(item, arguments[0]) for item in value)
        return len(value) == len(arguments) and all(map(fits, value, arguments))
    if origin in (list, Sequence):
        return isinstance(value, list | tuple) and all(fits(item, arguments[0]) for item in value)
    if origin in (dict, Mapping):
        return isinstance(value, Mapping) and all(
            fits(key, arguments[0]) and fits(item, arguments[1]) for key, item in value.items()
        )
    if isinstance(value, bool) or hint is bool:
        return isinstance(value, bool) and hint is bool
    if hint is float:
        return isinstance(value, int | float)
    return isinstance(value, hint)


def _shown(value: Any) -> str:
    text = ascii(value) if not str(value).isprintable() else repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."
