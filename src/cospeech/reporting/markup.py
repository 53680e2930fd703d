"""Text that comes from data, in pages, tables, pictures and terminals: shown, never obeyed."""

from __future__ import annotations

import html
import re

# Controls (a terminal obeys escape sequences), what turns the direction of all text that follows,
# and halves of surrogate pairs, which no file can be written with. Line ends and tabs stay.
_UNSHOWABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_MARKDOWN = re.compile(r"[\\`|<\[]")


def plain(text: object) -> str:
    """A text whose control characters, direction overrides and lone surrogates are U+FFFD."""
    return _UNSHOWABLE.sub("\ufffd", str(text))


def one_line(text: object) -> str:
    """As `plain`, with line ends and tabs as spaces."""
    return re.sub(r"[\n\t\u2028\u2029]", " ", plain(text))


def escaped(text: object) -> str:
    """As `plain`, for the content or a quoted attribute of an HTML or SVG element."""
    return html.escape(plain(text))


def markdown(text: object) -> str:
    """As `one_line`, for Markdown: no HTML, link, picture, code or cell begins in it."""
    return _MARKDOWN.sub(r"\\\g<0>", one_line(text))
