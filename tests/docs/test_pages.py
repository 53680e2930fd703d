"""Pages that are files of the project."""

import importlib.util
from types import SimpleNamespace

import yaml

from cospeech.corpus.features import FIELDS
from tests.docs.pages import PROJECT

DOCS = PROJECT / "docs"
SPEC = importlib.util.spec_from_file_location("hooks", DOCS / "hooks.py")
assert SPEC is not None
assert SPEC.loader is not None
HOOKS = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(HOOKS)


class Files:
    """What mkdocs hands over, as far as it is used."""

    def documentation_pages(self):
        return [
            SimpleNamespace(
                src_uri=path.relative_to(DOCS).as_posix(),
                content_string=path.read_text(encoding="utf-8"),
            )
            for path in DOCS.rglob("*.md")
        ]


def shown(name: str) -> str:
    page = SimpleNamespace(file=SimpleNamespace(src_uri=name))
    text = (DOCS / name).read_text(encoding="utf-8")
    return HOOKS.on_page_markdown(text, page, Files())


def test_every_method_and_judge_has_a_page_that_is_its_readme():
    readmes = [
        path
        for folder in ("methods", "judges")
        for path in (PROJECT / "src/cospeech" / folder).rglob("README.md")
    ]
    assert len(readmes) >= 6
    included = {shown(page.src_uri) for page in Files().documentation_pages()}
    titles = {text.split("\n", 1)[0] for text in included}
    assert {path.read_text(encoding="utf-8").split("\n", 1)[0] for path in readmes} <= titles


def test_links_of_a_readme_lead_to_pages_and_pictures_of_the_site():
    text = shown("methods/motion_matching.md")
    assert "](../keyword_demo.png)" in text
    assert "](controls.md)" in text
    assert "](motion_matching.md)" in shown("methods/refinement.md")
    assert "](CHANGELOG.md)" not in shown("contributing.md")
    assert "](changelog.md)" in shown("contributing.md")


def test_every_field_is_on_its_page_with_its_axis_its_unit_and_its_values():
    rows = [
        [cell.strip() for cell in line.strip("|").split(" | ")]
        for line in shown("fields.md").splitlines()
        if line.startswith("| `")
    ]
    assert [row[0] for row in rows] == [f"`{name}`" for name in FIELDS]
    assert [row[1:3] for row in rows] == [[f.axis, f.unit] for f in FIELDS.values()]
    of = {row[0]: row for row in rows}
    assert "-1 where nobody annotated" in of["`phases`"][2]
    assert of["`words`"][4:] == ["int64", "words"]
    assert of["`cepstra`"][3] == "28"
    assert len({len(row) for row in rows}) == 1


def test_every_page_can_be_reached():
    def leaves(item) -> list[str]:
        if isinstance(item, str):
            return [item]
        parts = item.values() if isinstance(item, dict) else item
        return [leaf for part in parts for leaf in leaves(part)]

    nav = yaml.safe_load((PROJECT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert sorted(leaves(nav)) == sorted(page.src_uri for page in Files().documentation_pages())
