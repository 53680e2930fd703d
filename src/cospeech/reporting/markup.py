"""Text that comes from data, in pages, tables, pictures and terminals: shown, never obeyed."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from importlib.resources import files

from cospeech.errors import one_line as one_line
from cospeech.errors import plain as plain

_MARKDOWN = re.compile(r"[\\`|<\[]")


def escaped(text: object) -> str:
    """As `plain`, for the content or a quoted attribute of an HTML or SVG element."""
    return html.escape(plain(text))


def html_page(title: str, body: Iterable[str], *sheets: str) -> str:
    """A page that needs no other file.

    Args:
        title: Of its window, escaped.
        body: Its elements; empty ones are left out.
        sheets: Style sheets of this package beside ``report.css``, which every page has.
    """
    css = "".join(
        (files("cospeech.reporting") / sheet).read_text(encoding="utf-8")
        for sheet in ("report.css", *sheets)
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{css}</style></head>\n<body>\n"
        + "\n".join(filter(None, body))
        + "\n</body></html>\n"
    )


def markdown(text: object) -> str:
    """As `one_line`, for Markdown: no HTML, link, picture, code or cell begins in it."""
    return _MARKDOWN.sub(r"\\\g<0>", one_line(text))
