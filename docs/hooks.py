"""Pages that are a file of the project, with links that lead within the site, or a table of it."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from posixpath import relpath
from typing import Any

import numpy as np

from cospeech.corpus.features import FIELDS

PROJECT = Path(__file__).resolve().parents[1]
INCLUDED = re.compile(r"^\{\{ (\S+) \}\}$", re.MULTILINE)
FIELDS_TABLE = "cospeech.corpus.features.FIELDS"
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?:|#)([^)#\s]+)(#[^)\s]*)?\)")


def on_page_markdown(markdown: str, page: Any, files: Any, **_: Any) -> str:
    """Put in what a page is made of: a line ``{{ FILE }}`` is the file of the project.

    ``{{ cospeech.corpus.features.FIELDS }}`` is the table of what a batch can hold.

    Args:
        markdown: The page as written.
        page: Its page.
        files: All files of the site.
    """
    return INCLUDED.sub(lambda found: _text(found[1], page.file.src_uri, files), markdown)


def _text(name: str, page: str, files: Any) -> str:
    if name == FIELDS_TABLE:
        return _fields_table()
    pages = {
        found[1]: file.src_uri
        for file in files.documentation_pages()
        if (found := INCLUDED.match(file.content_string))
    }

    def within_the_site(link: re.Match[str]) -> str:
        shown, text, path, place = link.groups(default="")
        target = PurePosixPath(_normal(f"{PurePosixPath(name).parent}/{path}"))
        uri = pages.get(str(target))
        if uri is None and target.parts[0] == "docs":
            uri = str(target.relative_to("docs"))
        if uri is None:
            return f"{text} (`{target}`)"
        return f"{shown}[{text}]({relpath(uri, PurePosixPath(page).parent)}{place})"

    return LINK.sub(within_the_site, (PROJECT / name).read_text(encoding="utf-8"))


def _fields_table() -> str:
    head = ("field", "axis", "unit and values", "numbers per step", "type", "made from")
    rows: list[tuple[str, ...]] = [head, ("---",) * len(head)]
    for field in FIELDS.values():
        width = "as the skeleton says" if field.width is None else f"{field.width}"
        kind = np.dtype(field.dtype).name
        rows.append((f"`{field.name}`", field.axis, field.unit, width, kind, field.reads))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _normal(path: str) -> str:
    return relpath(path, ".")
