"""Schedules of controls: which criterion holds when, or with which spoken word."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from cospeech.errors import ConfigError, InputFileError
from cospeech.foreign import read_json, read_yaml
from cospeech.matching.control.expressions import Criterion, parse_criterion
from cospeech.matching.control.words import WordPattern
from cospeech.suggestions import did_you_mean

MOST_BYTES = 2**18
MOST_ENTRIES = 1000
_LATEST_S = 1e9

WhenEmpty = Literal["ignore", "previous", "error"]
"""What a step does whose criteria leave no window: go without control, keep the step before's
control, or stop."""

_SPAN_KEYS = ("from_s", "to_s", "where")
_WORD_KEYS = ("word", "where")
_TOP_KEYS = ("controls", "when_empty")
_EXAMPLES = (
    "an entry is {from_s: 0, to_s: 10, where: left_wrist_height >= p85} with either time left out,"
    " or {word: big|huge, where: hands_distance > p80} with `where` left out; inside { } a"
    " criterion with commas needs quotes"
)


@dataclass(frozen=True)
class SpanControl:
    """A criterion for a time span of the speech.

    Attributes:
        where: What has to hold.
        from_s: Start of the span, s.
        to_s: Its end, s; infinity for the end of the speech.
    """

    where: Criterion
    from_s: float = 0.0
    to_s: float = math.inf


@dataclass(frozen=True)
class KeywordControl:
    """A criterion while certain words are spoken.

    Attributes:
        word: Words of the speech to gesture to.
        where: What has to hold with them; by default, that such a word is spoken in the database.
    """

    word: WordPattern
    where: Criterion


@dataclass(frozen=True)
class Controls:
    """What motion shall be like, and when.

    Spans that overlap hold together. A keyword replaces them while it is spoken.

    Attributes:
        spans: Criteria for time spans.
        keywords: Criteria for spoken words; of two at one step, that of the word which takes more
            of the step counts, or else the earlier entry.
        when_empty: See `WhenEmpty`.
    """

    spans: tuple[SpanControl, ...] = ()
    keywords: tuple[KeywordControl, ...] = ()
    when_empty: WhenEmpty = "ignore"

    @classmethod
    def from_dict(cls, values: Mapping[str, Any] | Sequence[Any] | str) -> Controls:
        """From plain values, as a yaml or JSON file holds them.

        Args:
            values: ``{"controls": [entry, ...], "when_empty": "ignore"}``, the list of entries
                alone, one entry alone, or one expression for all of the speech.

        Raises:
            ConfigError: Something isn't understood; the message names the entry.
        """
        when_empty: Any = "ignore"
        entries: Any = values
        if isinstance(values, str):
            entries = [{"where": values}]
        elif isinstance(values, Mapping):
            if set(values) & {*_SPAN_KEYS, *_WORD_KEYS}:
                entries = [values]
            else:
                _require_keys("the controls", values, _TOP_KEYS)
                entries = values.get("controls", [])
                if isinstance(entries, str):
                    entries = [{"where": entries}]
                when_empty = values.get("when_empty", when_empty)
        if when_empty not in get_args(WhenEmpty):
            known = ", ".join(get_args(WhenEmpty))
            raise ConfigError(f"when_empty={when_empty!r} is not one of {known}")
        if isinstance(entries, (str, bytes)) or not isinstance(entries, Sequence):
            raise ConfigError(f"controls are a list of entries, not {entries!r:.80}", _EXAMPLES)
        if len(entries) > MOST_ENTRIES:
            raise ConfigError(f"{len(entries)} controls, more than {MOST_ENTRIES}")
        read = [_entry(number, entry) for number, entry in enumerate(entries, 1)]
        return cls(
            tuple(entry for entry in read if isinstance(entry, SpanControl)),
            tuple(entry for entry in read if isinstance(entry, KeywordControl)),
            cast(WhenEmpty, when_empty),
        )


def read_controls(path: str | Path) -> Controls:
    """Read a schedule from a yaml or JSON file.

    Raises:
        InputFileError: It can't be read, or is neither yaml nor JSON.
        ConfigError: Something in it isn't understood; the message names file and entry.
    """
    values = read_values(path)
    try:
        return Controls.from_dict(values)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error.problem}", error.hint) from None


def read_values(path: str | Path) -> dict[str, Any] | list[Any] | str:
    """What a yaml or JSON file of controls holds, as `Controls.from_dict` takes it.

    Raises:
        InputFileError: It can't be read, or is neither yaml nor JSON.
    """
    is_json = Path(path).suffix.lower() == ".json"
    read = read_json if is_json else read_yaml
    values = read(path, "a schedule of controls", MOST_BYTES, _EXAMPLES)
    if values is None:
        raise InputFileError(path, "is empty", hint=_EXAMPLES)
    if not isinstance(values, (dict, list, str)):
        raise InputFileError(path, "holds no list of controls", hint=_EXAMPLES)
    return values


def _entry(number: int, values: Any) -> SpanControl | KeywordControl:
    name = f"control {number}"
    if isinstance(values, str):
        values = {"where": values}
    if not isinstance(values, Mapping):
        raise ConfigError(f"{name} is {values!r:.80}, not a mapping", _EXAMPLES)
    if "word" in values:
        _require_keys(name, values, _WORD_KEYS)
        pattern = _named(name, "word", lambda: WordPattern(_text(values["word"])))
        quote = "'" if '"' in pattern.text else '"'
        text = values.get("where", f"word({quote}{pattern.text}{quote})")
        return KeywordControl(pattern, _named(name, "where", lambda: parse_criterion(text)))
    _require_keys(name, values, _SPAN_KEYS)
    if "where" not in values:
        raise ConfigError(f"{name} has no criterion (where)", _EXAMPLES)
    criterion = _named(name, "where", lambda: parse_criterion(values["where"]))
    from_s, to_s = (
        _time(name, key, values.get(key), default)
        for key, default in (("from_s", 0.0), ("to_s", math.inf))
    )
    if to_s <= from_s:
        raise ConfigError(
            f"{name} ends before it begins: from_s={from_s:g}, to_s={to_s:g}",
            "let to_s be later than from_s, or leave one out",
        )
    return SpanControl(criterion, from_s, to_s)


def _require_keys(name: str, values: Mapping[str, Any], valid: Sequence[str]) -> None:
    for key in values:
        if key not in valid:
            near = did_you_mean(str(key), valid)
            raise ConfigError(
                f"{name} has a key {key!r}{near}; valid here: {', '.join(valid)}", _EXAMPLES
            )


def _named(name: str, key: str, make: Any) -> Any:
    try:
        return make()
    except ConfigError as error:
        raise ConfigError(f"{name}, {key}: {error.problem}", error.hint) from None


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ConfigError(f"{value!r:.80} is not a text", "put words in quotes, e.g. 'yes|no'")
    return value


def _time(name: str, key: str, value: Any, default: float) -> float:
    if value is None:
        return default
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not 0 <= value <= _LATEST_S:
        raise ConfigError(f"{name}, {key}: {value!r:.80} is not a time in seconds", _EXAMPLES)
    return float(value)
