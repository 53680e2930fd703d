"""The text of a criterion: its syntax tree, and the place of what is wrong in it."""

from __future__ import annotations

import ast
import re
import warnings

from cospeech.errors import ConfigError

MOST_CHARACTERS = 1000
MOST_PARTS = 200
DEEPEST = 30

_LITERAL = re.compile(r'"[^"]*"|\'[^\']*\'|(?<![\w.])p\d+\.\d+(?![\w.])')
_FOREIGN = re.compile(r"[^ -~\t]")
_TELLING_SYNTAX_ERRORS = ("was never closed", "unmatched", "does not match")
_SHOWN_BEFORE, _SHOWN = 50, 100


class Source:
    """An expression's text and its tree in Python's syntax, which is never run.

    Args:
        text: The expression; line breaks are blanks.
        hint: What errors say to do next.

    Attributes:
        text: In one line.
        tree: The syntax tree. A percentile like ``p97.5`` is the name ``p97_5`` in it.

    Raises:
        ConfigError: It is too long, too deep or no expression.
    """

    def __init__(self, text: str, hint: str) -> None:
        if len(text) > MOST_CHARACTERS:
            raise ConfigError(
                f"the criterion {text[:60]!r}... has {len(text)} characters, more than"
                f" {MOST_CHARACTERS}",
                "say it shorter",
            )
        self.text, self._hint = " ".join(text.splitlines()).strip(), hint
        self._quoted: dict[int, str] = {}
        # Text in quotes is taken as it is written, and p97.5 has to be a name: both are replaced by
        # something as long, so that places stay what they are.
        self._masked = _LITERAL.sub(self._hide, self.text)
        if odd := _FOREIGN.search(self._masked):
            raise self.fault_at(*odd.span(), f"{odd.group()!r} isn't part of the language")
        self.tree = self._parsed()
        self._require_small()

    def quoted(self, node: ast.expr) -> str | None:
        """What stands between the quotes of a node, backslashes and all; None if it has none."""
        text = self._quoted.get(node.col_offset) if isinstance(node, ast.Constant) else None
        # Python joins neighbours: one text, of which the first would be taken alone.
        single = text is not None and node.end_col_offset == node.col_offset + len(text) + 2
        return text if single else None

    def written(self, node: ast.expr) -> str:
        """The text of a node."""
        return self.text[node.col_offset : node.end_col_offset]

    def fault(self, node: ast.expr, message: str) -> ConfigError:
        """An error that points at a node."""
        return self.fault_at(node.col_offset, node.end_col_offset or node.col_offset + 1, message)

    def fault_at(self, start: int, stop: int, message: str) -> ConfigError:
        """An error that points at a stretch of the text."""
        cut = max(0, start - _SHOWN_BEFORE)
        shown = self.text[cut : cut + _SHOWN]
        marks = (" " * (start - cut) + "^" * max(1, stop - start))[: max(1, len(shown))]
        return ConfigError(
            f"in the criterion {self.text!r}, character {start + 1}: {message}"
            f"\n     {shown}\n     {marks}",
            self._hint,
        )

    def _hide(self, found: re.Match[str]) -> str:
        literal = found.group()
        if literal[0] == "p":
            return literal.replace(".", "_")
        self._quoted[found.start()] = literal[1:-1]
        return literal[0] + "_" * (len(literal) - 2) + literal[0]

    def _parsed(self) -> ast.expr:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's advice on style
                return ast.parse(self._masked, mode="eval").body
        except SyntaxError as error:
            place = max(0, min((error.offset or 1) - 1, len(self.text) - 1))
            telling = any(part in error.msg for part in _TELLING_SYNTAX_ERRORS)
            message = error.msg if telling else "not understood from here on"
            raise self.fault_at(place, place + 1, message) from None
        except (ValueError, RecursionError, MemoryError):
            problem = "not understood: too deep, or a number too long"
            raise self.fault_at(0, len(self.text), problem) from None

    def _require_small(self) -> None:
        level: list[ast.AST] = [self.tree]
        parts = depth = 0
        while level:
            parts, depth = parts + len(level), depth + 1
            if parts > MOST_PARTS or depth > DEEPEST:
                problem = f"more than {MOST_PARTS} parts, or nested more than {DEEPEST} deep"
                raise self.fault_at(0, len(self.text), problem)
            level = [
                child
                for node in level
                for child in ast.iter_child_nodes(node)
                if isinstance(child, ast.expr)
            ]
