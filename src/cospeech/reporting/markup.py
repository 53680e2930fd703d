"""Text that comes from data, in pages, tables, pictures and terminals: shown, never obeyed."""

from __future__ import annotations

import html
import re
from collections.abc import Container, Iterable, Sequence
from importlib.resources import files
from importlib.resources.abc import Traversable

from cospeech.errors import one_line as one_line
from cospeech.errors import plain as plain

_MARKDOWN = re.compile(r"[\\`|<\[]")


def escaped(text: object) -> str:
    """As `plain`, for the content or a quoted attribute of an HTML or SVG element."""
    return html.escape(plain(text))


def html_page(title: str, body: Iterable[str], *sheets: Traversable) -> str:
    """A page that needs no other file.

    Args:
        title: Of its window, escaped.
        body: Its elements; empty ones are left out.
        sheets: Style sheets beside ``report.css``, which every page has.
    """
    common = files("cospeech.reporting") / "report.css"
    css = "".join(sheet.read_text(encoding="utf-8") for sheet in (common, *sheets))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{css}</style></head>\n<body>\n"
        + "\n".join(filter(None, body))
        + "\n</body></html>\n"
    )


def html_sections(sections: Sequence[tuple[str, str, str]]) -> list[str]:
    """Links to all sections of a page, and each under its heading.

    Args:
        sections: Id, heading and content of each, HTML.
    """
    links = "\n".join(f'<a href="#{key}">{heading}</a>' for key, heading, _ in sections)
    shown = (f'<h2 id="{key}">{heading}</h2>{content}' for key, heading, content in sections)
    return [f"<nav>{links}</nav>", *shown]


def html_facts(facts: Iterable[tuple[str, str]]) -> str:
    """A list of names with their values, both HTML."""
    rows = "".join(f"<dt>{name}</dt><dd>{value}</dd>" for name, value in facts)
    return f'<dl class="facts">{rows}</dl>'


def html_table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    numbers: Container[int] = (),
    style: str = "",
) -> str:
    """A table of cells that are HTML.

    Args:
        heads: Of the columns; without any there is no such line.
        rows: Cells of each.
        numbers: Which columns are at the right of their place, from 0.
        style: CSS class.
    """

    def line(tag: str, cells: Sequence[str]) -> str:
        opened = (f'{tag} class="number"' if i in numbers else tag for i in range(len(cells)))
        shown = (f"<{start}>{cell}</{tag}>" for start, cell in zip(opened, cells, strict=True))
        return f"<tr>{''.join(shown)}</tr>"

    lines = [line("td", row) for row in rows]
    if heads:
        lines.insert(0, line("th", heads))
    opened = f'<table class="{style}">' if style else "<table>"
    return f"{opened}{''.join(lines)}</table>"


def markdown(text: object) -> str:
    """As `one_line`, for Markdown: no HTML, link, picture, code or cell begins in it."""
    return _MARKDOWN.sub(r"\\\g<0>", one_line(text))
