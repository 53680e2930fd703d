"""The language of criteria: conditions on quantities, phases and words, true or false per frame.

An expression is parsed into Python's syntax tree and translated node by node; nothing of it is ever
run as Python, and whatever isn't in the language is refused where it stands.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import reduce
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError
from cospeech.matching.control.quantities import QUANTITIES, Values
from cospeech.matching.control.source import Source
from cospeech.matching.control.words import WordPattern
from cospeech.motion.phases import PHASE_INDEX, PHASES
from cospeech.suggestions import did_you_mean

CONSTANTS: dict[str, float] = {"cm": 0.01, "m": 1.0, "s": 1.0}
"""Units to write numbers with: ``22*cm``, ``19*cm/s``."""

Mask = NDArray[np.bool_]


class Frames(Protocol):
    """What criteria are asked about: frames with quantities, phases and words."""

    def quantity(self, name: str) -> Values:
        """A quantity of every frame."""

    def percentile(self, of: Number, key: str, percent: float) -> np.float64:
        """A percentile of a number over a database; ``key`` is what the number is called."""

    def phases(self) -> NDArray[np.int8]:
        """Index into `PHASES` of every frame, -1 where unknown."""

    def spoken(self, pattern: WordPattern) -> Mask:
        """Whether a word is spoken that matches."""

    def everywhere(self, value: np.bool_) -> Mask:
        """The same for every frame."""


Number = Callable[[Frames], "Values | np.float64"]
_Truth = Callable[[Frames], "Mask | np.bool_"]
_Other = tuple[ast.expr, Number] | None
"""The other side of a comparison, for percentiles of it."""


@dataclass(frozen=True)
class Criterion:
    """A parsed expression; `parse_criterion` makes it.

    Attributes:
        text: The expression.
    """

    text: str
    _truth: _Truth = field(repr=False, compare=False)

    def __call__(self, frames: Frames) -> Mask:
        """Whether it holds, for every frame; those with no finite number don't."""
        with np.errstate(all="ignore"):
            truth = self._truth(frames)
        return truth if isinstance(truth, np.ndarray) else frames.everywhere(truth)


def parse_criterion(text: str) -> Criterion:
    """Parse an expression; the package's README describes the language.

    Raises:
        ConfigError: It isn't in the language. The message shows the place and the valid names.
    """
    if not isinstance(text, str) or not text.strip():
        raise ConfigError(f"a criterion is a text, not {text!r:.80}", _WHAT_THERE_IS)
    source = Source(text, _WHAT_THERE_IS)
    return Criterion(source.text, _Translation(source).condition(source.tree))


_ORDER: dict[type[ast.cmpop], Callable[..., Mask]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_ARITHMETIC: dict[type[ast.operator], Callable[..., Values]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: dict[str, Callable[..., Values]] = {
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
    "abs": np.abs,
}
_PERCENTILE = re.compile(r"p(\d+(?:_\d+)?)")
_WHAT_THERE_IS = (
    f"quantities: {', '.join(QUANTITIES)}\n"
    "     numbers: 0.2, 22*cm, 19*cm/s, p85 (the database's percentile of what it is compared"
    " with); + - * / abs() min() max()\n"
    '     conditions: < <= > >=, and or not, word("big|huge"), phase == stroke'
    f" (phases: {', '.join(PHASES)})"
)


class _Translation:
    """From a syntax tree to functions of frames."""

    def __init__(self, source: Source) -> None:
        self._source = source

    def condition(self, node: ast.expr) -> _Truth:
        match node:
            case ast.BoolOp():
                parts = [self.condition(value) for value in node.values]
                join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
                return lambda frames: reduce(join, [part(frames) for part in parts])
            case ast.UnaryOp(op=ast.Not()):
                part = self.condition(node.operand)
                return lambda frames: np.logical_not(part(frames))
            case ast.Compare():
                return self._comparison(node)
            case ast.Call(func=ast.Name(id="word")):
                return self._word(node)
            case ast.Name(id=name) if name in PHASE_INDEX:
                raise self._source.fault(node, f"a phase alone; write phase == {name}")
            case ast.Name() | ast.Constant() | ast.BinOp() | ast.UnaryOp() | ast.Call():
                self._number(node)
                example = "compare it with something, e.g. left_wrist_height > p85"
                raise self._source.fault(node, f"a number, where a condition is wanted: {example}")
        raise self._foreign(node)

    def _comparison(self, node: ast.Compare) -> _Truth:
        sides = [node.left, *node.comparators]
        if any(isinstance(side, ast.Name) and side.id == "phase" for side in sides):
            return self._phase(node)
        parts = []
        for left, right, sign in zip(sides, sides[1:], node.ops, strict=False):
            if type(sign) not in _ORDER:
                raise self._source.fault(node, "numbers are compared by < <= > >=")
            parts.append(self._ordered(_ORDER[type(sign)], left, right))
        return lambda frames: reduce(np.logical_and, [part(frames) for part in parts])

    def _ordered(self, order: Callable[..., Mask], left: ast.expr, right: ast.expr) -> _Truth:
        relative = [_has(_is_percentile, side) for side in (left, right)]
        if all(relative):
            raise self._source.fault(right, "a percentile on both sides: of what would they be?")
        if relative[0]:
            second = self._number(right)
            first = self._number(left, (right, second))
        else:
            first = self._number(left)
            second = self._number(right, (left, first))

        def truth(frames: Frames) -> Mask:
            smaller, larger = first(frames), second(frames)
            held: Mask = order(smaller, larger) & np.isfinite(smaller) & np.isfinite(larger)
            return held

        return truth

    def _phase(self, node: ast.Compare) -> _Truth:
        if len(node.ops) != 1 or not isinstance(node.ops[0], (ast.Eq, ast.NotEq)):
            raise self._source.fault(node, "phases are asked for by phase == NAME, phase != NAME")
        first_is_phase = isinstance(node.left, ast.Name) and node.left.id == "phase"
        named = node.comparators[0] if first_is_phase else node.left
        name = named.id if isinstance(named, ast.Name) else self._source.quoted(named)
        if name not in PHASE_INDEX:
            near = did_you_mean(name or "", PHASES)
            raise self._source.fault(
                named, f"there is no phase {self._source.written(named)}{near}"
            )
        wanted, equal = PHASE_INDEX[name], isinstance(node.ops[0], ast.Eq)

        def truth(frames: Frames) -> Mask:
            phases = frames.phases()
            return phases == wanted if equal else (phases != wanted) & (phases >= 0)

        return truth

    def _word(self, node: ast.Call) -> _Truth:
        quoted = self._source.quoted(node.args[0]) if len(node.args) == 1 else None
        if node.keywords or quoted is None:
            raise self._source.fault(
                node, 'word() takes one pattern in quotes, e.g. word("big|huge")'
            )
        try:
            pattern = WordPattern(quoted)
        except ConfigError as error:
            raise self._source.fault(node.args[0], error.problem) from None
        return lambda frames: frames.spoken(pattern)

    def _number(self, node: ast.expr, other: _Other = None) -> Number:
        match node:
            case ast.Constant(value=bool()):
                raise self._source.fault(node, f"{node.value!r} isn't a number")
            case ast.Constant(value=int(value) | float(value)):
                return self._constant(node, value)
            case ast.Constant():
                raise self._source.fault(node, f"{self._source.written(node)} isn't a number")
            case ast.Name():
                return self._name(node, other)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
                part = self._number(node.operand, other)
                sign = -1 if isinstance(node.op, ast.USub) else 1
                return lambda frames: sign * part(frames)
            case ast.BinOp() if type(node.op) in _ARITHMETIC:
                combine = _ARITHMETIC[type(node.op)]
                first, second = (self._number(side, other) for side in (node.left, node.right))
                return lambda frames: combine(first(frames), second(frames))
            case ast.BinOp(op=ast.BitAnd() | ast.BitOr()):
                raise self._source.fault(node, "write `and`, `or` instead of &, |")
            case ast.BinOp():
                raise self._source.fault(node, "this operator isn't known; there are + - * /")
            case ast.Call(func=ast.Name(id=name)) if name != "word":
                return self._function(node, name, other)
            case (
                ast.BoolOp() | ast.Compare() | ast.UnaryOp(op=ast.Not()) | ast.Call(func=ast.Name())
            ):
                raise self._source.fault(node, "a condition, where a number is wanted")
        raise self._foreign(node)

    def _constant(self, node: ast.expr, value: float) -> Number:
        try:
            number = np.float64(value)
        except OverflowError:
            number = np.float64(np.inf)
        if not np.isfinite(number):
            raise self._source.fault(node, "too large a number")
        return lambda frames: number

    def _name(self, node: ast.Name, other: _Other) -> Number:
        name = node.id
        if name in QUANTITIES:
            return lambda frames: frames.quantity(name)
        if name in CONSTANTS:
            return self._constant(node, CONSTANTS[name])
        if _is_percentile(name):
            return self._percentile(node, other)
        if name in _FUNCTIONS or name == "word":
            raise self._source.fault(node, f"{name} is a function: {name}(...)")
        if name == "phase" or name in PHASE_INDEX:
            raise self._source.fault(node, "a phase isn't a number; write phase == stroke")
        near = did_you_mean(name.lower(), [*QUANTITIES, *_FUNCTIONS, "phase", "word"])
        raise self._source.fault(node, f"there is no quantity {name!r}{near}")

    def _percentile(self, node: ast.Name, other: _Other) -> Number:
        written = self._source.written(node)
        percent = float(written[1:].replace("_", "."))
        if percent > 100:
            raise self._source.fault(node, "percentiles go from p0 to p100")
        if other is None or not _has(QUANTITIES.__contains__, other[0]):
            message = f"a percentile of what? Compare it with a quantity, e.g. speed > {written}"
            raise self._source.fault(node, message)
        key, number = self._source.written(other[0]), other[1]
        return lambda frames: frames.percentile(number, key, percent)

    def _function(self, node: ast.Call, name: str, other: _Other) -> Number:
        if name not in _FUNCTIONS:
            near = did_you_mean(name, [*_FUNCTIONS, "word"])
            raise self._source.fault(node.func, f"there is no function {name!r}{near}")
        single = name == "abs"
        if node.keywords or (len(node.args) != 1 if single else len(node.args) < 2):
            wanted = "one number" if single else "two numbers or more"
            raise self._source.fault(node, f"{name}() takes {wanted}")
        compute = _FUNCTIONS[name]
        parts = [self._number(argument, other) for argument in node.args]
        return lambda frames: compute(*(part(frames) for part in parts))

    def _foreign(self, node: ast.expr) -> ConfigError:
        return self._source.fault(node, "this isn't part of the language")


def _is_percentile(name: str) -> bool:
    return _PERCENTILE.fullmatch(name) is not None


def _has(wanted: Callable[[str], bool], node: ast.expr) -> bool:
    """Whether any name in a tree is wanted."""
    return any(wanted(part.id) for part in ast.walk(node) if isinstance(part, ast.Name))
