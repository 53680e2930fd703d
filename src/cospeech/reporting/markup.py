"""Text that comes from data, in pages, tables, pictures and terminals: shown, never obeyed."""

from __future__ import annotations

import html
import re

from cospeech.errors import one_line as one_line
from cospeech.errors import plain as plain

_MARKDOWN = re.compile(r"[\\`|<\[]")


def escaped(text: object) -> str:
    """As `plain`, for the content or a quoted attribute of an HTML or SVG element."""
    return html.escape(plain(text))


def markdown(text: object) -> str:
    """As `one_line`, for Markdown: no HTML, link, picture, code or cell begins in it."""
    return _MARKDOWN.sub(r"\\\g<0>", one_line(text))
