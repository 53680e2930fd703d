"""A finished run in Python: the README's lines, away from the project and from Hydra's state."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hydra.core.global_hydra import GlobalHydra

import cospeech
from cospeech.errors import ConfigError
from cospeech.experiment.finished_run import load
from cospeech.experiment.known_parts import known_part, names_of
from tests.runs import CONF, Outputs

README = Path(__file__).resolve().parents[2] / "README.md"


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    (tmp_path_factory.mktemp("python") / "outputs" / "stores").mkdir(parents=True)
    return Outputs(tmp_path_factory.getbasetemp() / "python0" / "outputs")


@pytest.mark.parametrize("model", ["trimodal", "knn", "multi_adversary"])
def test_the_readmes_lines_run(model, outputs, monkeypatch):
    stage = "finished" if model == "multi_adversary" else None
    run = outputs.run(model, model, stage)
    monkeypatch.chdir(outputs.folder.parent)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if Path(p).resolve() != README.parent])
    Path("a.wav").write_bytes(outputs.audio.read_bytes())
    (lines,) = re.findall(r"```python\n(from cospeech import load.*?)```", README.read_text(), re.S)
    assert len([line for line in lines.splitlines() if line]) == 3
    names: dict = {}
    exec(lines.replace("outputs/runs/ID", str(run.relative_to(Path.cwd()))), names)
    assert len(names["motion"]) == np.ceil(3 * names["motion"].fps)
    assert names["motion"].first_bad_frame() is None
    assert not names["method"].training
    assert not GlobalHydra.instance().is_initialized()


def test_the_models_are_those_of_conf():
    assert names_of("model") == sorted(path.stem for path in (CONF / "model").glob("*.yaml"))
    known = known_part("model", "knn")
    assert known is not None
    assert known.target == "cospeech.methods.motion_matching.MotionMatching"
    assert known_part("model", "../callbacks/default") is None


def test_a_method_whose_corpus_is_gone_says_how_to_make_it(outputs, tmp_path):
    run = outputs.run("knn", name="moved").rename(tmp_path / "run")
    with pytest.raises(ConfigError, match=r"isn't here any more.*") as caught:
        load(run, store_folders=[tmp_path / "nowhere"])
    assert "python prepare.py data.store_dir=" in str(caught.value)
    assert load(run, store_folders=[outputs.folder / "stores"]).needs_store({})


def test_the_package_is_light_until_something_is_asked_of_it():
    code = (
        "import sys, cospeech; print([n for n in ('torch', 'hydra', 'numpy') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    with pytest.raises(AttributeError, match="nothing_there"):
        cospeech.nothing_there  # noqa: B018
