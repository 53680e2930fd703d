"""The how-tos do what they say."""

import importlib
import inspect
import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
import yaml
from hydra.utils import get_class

from cospeech.errors import CospeechError
from cospeech.experiment.settings import known_arguments
from tests.corpora import make_recording, make_store
from tests.docs.pages import PROJECT, Page, checkout, typed
from tests.fabricated.sound import save_wav

HOW_TOS = sorted(path.stem for path in (PROJECT / "docs" / "how_to").glob("*.md"))


class Added:
    """The files of a page, as if they lay in the project.

    Attributes:
        page: The page.
        folder: Where they lie.
    """

    def __init__(self, page: Page, folder, monkeypatch) -> None:
        self.page, self.folder = page, folder
        page.write(folder)
        for title in {block.title for block in page.files if block.language == "python"}:
            package = Path(title).parent
            if package.parts[0].endswith("tests"):  # or at the end of one of the project's
                continue
            if not (PROJECT / package).is_dir():
                package = package.parent  # of a package of the page's own
            module = importlib.import_module(".".join(package.parts).removeprefix("src."))
            path = [*module.__path__, str(folder / package)]
            monkeypatch.setattr(module, "__path__", path)

    def yamls(self) -> dict:
        """Path -> content of those that it has."""
        paths = self.folder.glob("conf/*/*.yaml")
        return {path: yaml.safe_load(path.read_text(encoding="utf-8")) for path in paths}

    def tests(self) -> dict:
        """The tests that the page itself has, by name."""
        names: dict = {}
        for block in self.page.files:
            if block.title.startswith("tests/"):
                exec(block.code, names)
        return {name: test for name, test in names.items() if name.startswith("test_")}


@pytest.fixture
def added(request, tmp_path, monkeypatch):
    yield Added(Page(f"how_to/{request.param}.md"), tmp_path, monkeypatch)
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


def page(name: str):
    return pytest.mark.parametrize("added", [name], indirect=True)


@pytest.mark.parametrize("name", HOW_TOS)
def test_every_piece_of_code_is_a_file_or_a_command(name):
    blocks = Page(f"how_to/{name}.md").blocks
    assert all(bool(block.title) is (block.language != "bash") for block in blocks)
    assert any(block.language == "python" for block in blocks)
    assert any(block.language == "bash" for block in blocks)


@pytest.mark.parametrize("added", ["add_a_method", "add_a_corpus"], indirect=True)
def test_a_yaml_has_every_argument_of_its_class(added):
    ((path, content),) = added.yamls().items()
    values = content.get(path.parent.name, content)
    target = values.pop("_target_")
    shared = {"defaults"}
    if path.parent.name == "data":
        base = yaml.safe_load((PROJECT / "conf/data/base.yaml").read_text(encoding="utf-8"))
        values |= base
    assert set(values) - shared == set(known_arguments(target)) - {"corpus"}


@pytest.mark.parametrize("added", ["add_a_metric", "add_an_adversary"], indirect=True)
def test_the_tests_of_a_page_pass(added, tmp_path):
    tests = added.tests()
    assert tests
    for test in tests.values():
        test(*[tmp_path / "store"] * len(inspect.signature(test).parameters))


@page("add_a_method")
def test_the_method_of_its_page_speaks_piece_by_piece(added, tmp_path):
    (content,) = added.yamls().values()
    store = make_store(tmp_path / "stores")
    method = get_class(content["model"].pop("_target_"))(store.facts(), **content["model"])
    speech = make_recording("a", seconds=3.14).speech
    whole = method.generate(speech)
    assert len(whole) == np.ceil(3.14 * 15)
    stream = method.open("ada")
    pieces = [stream.push(piece) for piece in np.array_split(speech.waveform, 7)]
    together = [piece.positions for piece in [*pieces, stream.finish()] if piece is not None]
    np.testing.assert_array_equal(np.concatenate(together), whole.positions)
    assert np.ptp(whole.positions, axis=0).max() > 1e-3


@page("add_a_corpus")
def test_the_corpus_of_its_page_is_read_and_damage_is_told(added, tmp_path):
    find_takes = importlib.import_module("cospeech.formats.positions").find_takes
    recording = make_recording("take", seconds=4)
    root = tmp_path / "root" / "ada"
    root.mkdir(parents=True)
    np.savez(root / "take.npz", positions=recording.motion.positions, fps=15.0)
    save_wav(root / "take.wav", recording.speech.waveform)
    (source,) = find_takes(root.parent)
    (read,) = source.read()
    np.testing.assert_array_equal(read.motion.positions, recording.motion.positions)
    assert (read.id, read.speaker, read.speech.duration) == ("ada-take", "ada", 4.0)
    assert all(path.is_file() for path in source.files)
    (root / "take.npz").write_bytes(b"no numbers")
    with pytest.raises(CospeechError, match=r"take\.npz"):
        list(source.read())
    with pytest.raises(CospeechError, match=r"data\.root"):
        find_takes(root)


@pytest.mark.parametrize("name", ["getting_started.md", "streams.md"])
def test_a_command_of_a_page_takes_the_newest_of_several_runs(name, tmp_path):
    for age, run in enumerate(("knn-synthetic-full-s1-2", "knn-z", "knn-synthetic-full-s0-3")):
        folder = tmp_path / "outputs" / "runs" / run
        folder.mkdir(parents=True)
        os.utime(folder, (1e9 - age, 1e9 - age))
    (tmp_path / "outputs/runs/knn_cgan-synthetic-full-s0-4").mkdir()
    choices = [found for line in Page(name).commands for found in re.findall(r'"\$\(.*?\)"', line)]
    assert choices
    for choice in choices:
        assert typed(f"echo {choice}", tmp_path) == "outputs/runs/knn-synthetic-full-s1-2\n"


def test_the_sound_of_getting_started_is_of_the_newest_of_several_stores(tmp_path, monkeypatch):
    takes = [make_recording(f"take{i}", seconds=8 + i, seed=i) for i in range(3)]
    for age, folder in enumerate(("b", "a", "c")):
        order = [*takes[age:], *takes[:age]]
        store = make_store(tmp_path / "outputs/stores" / folder, order)
        path = store.path.rename(tmp_path / "outputs/stores" / f"store-{folder}")
        (tmp_path / "outputs/stores" / folder).rmdir()
        os.utime(path / "manifest.json", (1e9 - age, 1e9 - age))
    (block,) = [b for b in Page("getting_started.md").files if b.title == "speech.py"]
    monkeypatch.chdir(tmp_path)
    exec(block.code, {})
    # the last take of the store b is the only one of ten seconds
    assert soundfile.info("speech.wav").duration == pytest.approx(10)


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("name", HOW_TOS)
def test_the_commands_of_a_how_to_run_in_a_checkout_with_its_files(name, tmp_path):
    page = Page(f"how_to/{name}.md")
    page.write(checkout(tmp_path))
    for command in page.commands:
        typed(command, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(2400)
def test_getting_started_and_the_stream_run_as_they_are_typed(tmp_path):
    checkout(tmp_path)
    for name in ("getting_started.md", "streams.md"):
        page = Page(name)
        page.write(tmp_path)
        printed = [typed(command, tmp_path) for command in page.commands]
        assert printed
    assert "finished: 150 frames at 15 fps" in printed[-1]
    assert list(tmp_path.glob("outputs/runs/knn-*/samples/player.html"))
