"""References to docs/facts lead to a section that is there."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
FACTS = PROJECT / "docs" / "facts"
READ = ("src", "data_modules", "callbacks", "conf", "benchmarks", "tests", "docs")

NUMBER = r"\d+(?:\.\d+)*"
SECTIONS = rf"sections? {NUMBER}(?:(?:, | and | to |, section | and section )(?:{NUMBER}))*"
REFERENCE = re.compile(rf"docs/facts/(?P<page>[\w.]+\.md)(?:, (?P<sections>{SECTIONS}))?")


def flat(text: str) -> str:
    """Text whose lines, of a docstring or of comments, have become one."""
    return re.sub(r"\s*\n\s*(?:#(?!\s*#) ?)?", " ", text)


def references(text: str) -> Iterator[tuple[str, list[str]]]:
    """Page and sections of each reference of a text."""
    for found in REFERENCE.finditer(flat(text)):
        yield found["page"], re.findall(NUMBER, found["sections"] or "")


def headings(page: Path) -> set[str]:
    """Numbers of the sections of a page."""
    text = page.read_text(encoding="utf-8")
    return set(re.findall(rf"^#+ ({NUMBER})\b", text, re.MULTILINE))


def all_references() -> list[tuple[Path, str, list[str]]]:
    paths = [
        path
        for folder in READ
        for path in (PROJECT / folder).rglob("*")
        if path.suffix in (".py", ".md", ".yaml") and path.parent != Path(__file__).parent
    ]
    return [
        (path, page, sections)
        for path in [*paths, *PROJECT.glob("*.md")]
        for page, sections in references(path.read_text(encoding="utf-8"))
    ]


def test_every_reference_leads_to_a_section():
    found = all_references()
    known = {page.name: headings(page) for page in FACTS.glob("*.md")}
    lost = [
        f"{path.relative_to(PROJECT)}: {page}, {number}"
        for path, page, sections in found
        for number in sections or [None]
        if page not in known or (number is not None and number not in known[page])
    ]
    assert lost == []
    assert len(found) > 100
    assert {page for _, page, _ in found} == set(known), "every page is referred to"


def test_nothing_refers_to_a_specification_that_isn_t_here():
    pattern = re.compile(r"\b[Ss]pec (?:[A-D]\.\d|D[, ]|\d)|\bspecs\b")
    texts = {
        path: path.read_text(encoding="utf-8")
        for folder in READ
        for path in (PROJECT / folder).rglob("*.py")
        if path != Path(__file__)
    }
    assert [str(path) for path, text in texts.items() if pattern.search(flat(text))] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x (docs/facts/a.md, section 3.6, step 2).", [("a.md", ["3.6"])]),
        ("docs/facts/a.md, sections 3.4, 3.7 and 3.8, and", [("a.md", ["3.4", "3.7", "3.8"])]),
        ("    # docs/facts/a.md, section\n    # 10, decision 4", [("a.md", ["10"])]),
        ("docs/facts/a.md, section 2 and section 9, decisions 1 to 3", [("a.md", ["2", "9"])]),
        ("see docs/facts/a.md", [("a.md", [])]),
    ],
)
def test_a_reference_is_read(text, expected):
    assert list(references(text)) == expected
