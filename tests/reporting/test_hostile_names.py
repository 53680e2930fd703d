"""Names from data are shown in pages, pictures and tables; none becomes markup, script or path."""

import logging
import re
import shutil
from collections import Counter
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from cospeech.files import write_text
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.markup import escaped, markdown, one_line, plain
from cospeech.reporting.tables import format_table
from cospeech.speech.speech import Word
from cospeech.studies.control_adherence.picture import Panel, plot_adherence
from cospeech.studies.synchrony.picture import plot_synchrony
from cospeech.studies.synchrony.rows import LAGS_S
from tests.corpora import REST_POSE
from tests.reporting.hostile_pages import PAGES

NAMES = (
    "</script><script>window.pwned=1</script>",
    '"><img src=x onerror=window.pwned=1>',
    "' onmouseover='window.pwned=1' x='",
    "--><svg onload=window.pwned=1>]]>",
    "</title></style><b>",
    "&lt;b&gt;&#60;i&#62;",
    "../../x",
    "/etc/x",
    "javascript:window.pwned=1",
    "nul\x00esc\x1b[2J\x9b",
    "\u202egnp.exe\u2066",
    "half \ud83d of it",
    "{title} %s {0} \\1 $x_{$",
    "two\nlines",
)


TOGETHER = (" ".join(NAMES[:6]), *NAMES[6:9], " ".join(NAMES[9:]))
"""Those that mean something by how they begin stand alone."""


class Structure(HTMLParser):
    """Elements with the names of their attributes, and what may run or lead elsewhere."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.values, self.text = [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, *(key for key, _ in attributes)))
        self.values += attributes

    def handle_comment(self, data):
        self.elements.append(("comment", data))

    def handle_data(self, data):
        self.text += data


def harmless(name):
    """As long, with spaces at the same places, and nothing that means anything."""
    return re.sub(r"[^ \n]", "x", name)


@pytest.mark.parametrize("kind", PAGES)
@pytest.mark.parametrize("name", TOGETHER, ids=range(len(TOGETHER)))
def test_no_element_attribute_or_script_comes_from_data(kind, name, tmp_path, caplog):
    caplog.set_level(logging.ERROR, "cospeech.corpus")  # pytest-xdist knows no half letters
    folders = tmp_path / "hostile", tmp_path / "harmless"
    pages = []
    for folder, given in zip(folders, (name, harmless(name)), strict=True):
        folder.mkdir()
        pages.append(PAGES[kind](folder, given).read_text(encoding="utf-8"))
    hostile, expected = map(Structure, pages)
    # what is sorted by name may stand in another order
    assert Counter(hostile.elements) == Counter(expected.elements)
    for key, value in hostile.values:
        assert not key.startswith("on")
        if key in ("href", "src"):
            assert not re.match(r"\s*[a-zA-Z][\w+.-]*:|/|\\", value), value
            assert not value.startswith("../")
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f]", pages[0])
    assert {path.name for path in tmp_path.iterdir()} == {"harmless", "hostile"}
    assert not (tmp_path.parent / "x").exists()


def test_names_are_still_there_to_be_read(tmp_path):
    for kind in ("report", "corpus", "figures"):
        (tmp_path / kind).mkdir()
        page = PAGES[kind](tmp_path / kind, "<Åsa & 'ß'>").read_text(encoding="utf-8")
        assert "<Åsa & 'ß'>" in Structure(page).text


def test_control_characters_and_halves_of_pairs_are_replaced():
    assert plain("a\x00\x1b[31m\u202eb\ud800\tc\n") == "a��[31m�b�\tc\n"
    assert one_line("a\nb\tc\r\u2028d") == "a b c� d"
    assert escaped('<a href="x">') == "&lt;a href=&quot;x&quot;&gt;"
    assert plain("שלום سلام Åsa 🎉 e\u0301") == "שלום سلام Åsa 🎉 e\u0301"


def test_tables_of_a_terminal_and_of_markdown_obey_no_name():
    rows = [{"name": name, "n": 1} for name in NAMES]
    text = format_table(rows)
    assert len(text.split("\n")) == len(rows) + 2
    assert "\x1b" not in text
    for line in format_table(rows, style="markdown").split("\n")[2:]:
        assert len(re.findall(r"(?<!\\)\|", line)) == 3
        assert not re.search(r"(?<!\\)[<`\[]", line)
    assert markdown("[a](b)|`c`<d>") == r"\[a](b)\|\`c\`\<d>"


def test_text_that_cannot_be_encoded_is_written(tmp_path):
    write_text(tmp_path / "a.html", "a\ud800b")
    assert (tmp_path / "a.html").read_bytes() == b"a?b"


@pytest.mark.parametrize("name", TOGETHER, ids=range(len(TOGETHER)))
def test_pictures_take_any_name(name, tmp_path):
    curve = np.linspace(0, 1, 30)
    panels = [Panel(name, "cm/s", {name: curve}, curve, [(0.0, 1.0, 0.1, 0.5)])]
    found = SimpleNamespace(lift=SimpleNamespace(value=0.1), interval=(0.0, 0.2))
    at_lag = SimpleNamespace(audio_to_motion=found, motion_to_audio=found)
    row = SimpleNamespace(name=name, at_lag=at_lag, profile=np.zeros((len(LAGS_S), 2)))
    plot_adherence(panels, 15.0, name, tmp_path / "a.svg")
    plot_synchrony([row], 0.1, name, tmp_path / "b.svg")
    for file, times in (("a.svg", 3), ("b.svg", 1)):
        root = ElementTree.parse(tmp_path / file).getroot()
        written = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
        assert written.count(one_line(name)) == times
        assert sum(one_line(name) in text for text in written) == times + (file == "b.svg")
        assert not any(key.startswith("on") for element in root.iter() for key in element.attrib)
    assert {path.name for path in tmp_path.iterdir()} == {"a.svg", "b.svg"}


def test_videos_show_any_word(tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="the video extra is not installed")
    from cospeech.reporting.drawing import FigurePainter

    motion = Motion(UPPER_BODY, 15.0, np.repeat(REST_POSE[None], 4, axis=0))
    for name in NAMES:
        image = FigurePainter({name: motion}, (320, 180)).paint(0.1, (Word(name, 0.0, 0.2),))
        assert image.size == (320, 180)


@pytest.mark.slow
def test_no_name_runs_in_a_browser(tmp_path):
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("no chromium on this machine")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for kind, write in PAGES.items():
            for i, name in enumerate(TOGETHER):
                folder = tmp_path / f"{kind}-{i}"
                folder.mkdir()
                page = browser.new_page()
                asked = []
                page.on("request", lambda request, asked=asked: asked.append(request.url))
                path = write(folder, name)
                page.goto(path.as_uri())
                page.mouse.move(300, 200)
                page.wait_for_timeout(50)
                assert page.evaluate("typeof window.pwned") == "undefined", (kind, name)
                assert page.locator("img[src=x], svg[onload], [onmouseover]").count() == 0
                others = [u for u in asked if u != path.as_uri() and not u.startswith("blob:")]
                assert others == []
                page.close()
        browser.close()
