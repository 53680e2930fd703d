"""XML from strangers: nothing is fetched, nothing expands, everything is bounded."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from cospeech.errors import ContentError
from cospeech.foreign import read_bytes
from cospeech.formats.phase_files.tiers import MAX_BYTES, MAX_ENTRIES

MAX_DEPTH = 64


def read_xml(path: Path, root_tag: str) -> Element:
    """The document's root element.

    A document type without declarations of its own is passed over; one that declares entities is
    refused, and no external part is ever opened.

    Args:
        path: The file, in any encoding that its first line names.
        root_tag: What the root element must be called.

    Raises:
        ContentError: It can't be read, isn't well-formed, declares entities, is too large or has
            another root element.
    """
    data = read_bytes(path, "an annotation file", MAX_BYTES)
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
    elements = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal elements, depth
        elements, depth = elements + 1, depth + 1
        if elements > MAX_ENTRIES or depth > MAX_DEPTH:
            raise refusal(f"more than {MAX_ENTRIES} elements, or {MAX_DEPTH} inside one another")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refusal(problem: str) -> ContentError:
        return ContentError(problem, place=f"line {parser.CurrentLineNumber}")

    def refuse_entity(*_: Any) -> int:
        raise refusal("declares or uses an XML entity, which no annotation file needs")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse_entity
    parser.ExternalEntityRefHandler = refuse_entity
    parser.SkippedEntityHandler = refuse_entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ContentError(
            f"not well-formed XML: {expat.ErrorString(error.code)}", f"line {error.lineno}"
        ) from error
    except (LookupError, ValueError) as error:
        raise ContentError(f"not readable as XML: {error}") from error
    root = builder.close()
    if root.tag != root_tag:
        raise ContentError(f"the root element is {root.tag!r}, expected {root_tag!r}")
    return root
