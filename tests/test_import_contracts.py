"""The import contracts cover every room and every method by pattern."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
METHODS = sorted(path.parent.name for path in (ROOT / "src/cospeech/methods").glob("*/__init__.py"))


def contracts():
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return pyproject["tool"]["importlinter"]["contracts"]


@pytest.mark.parametrize("contract", contracts(), ids=lambda contract: contract["name"])
def test_no_contract_lists_methods_or_rooms(contract):
    covered = [
        module
        for key in ("modules", "source_modules", "forbidden_modules", "containers")
        for module in contract.get(key, [])
    ]
    named = {part for module in covered for part in module.split(".")}
    assert not named & set(METHODS)
    whole = {"cospeech", "cospeech.*", "cospeech.methods", "cospeech.methods.*"}
    rooms = {module for module in covered if module.startswith("cospeech")} - whole
    assert rooms <= {"cospeech.experiment"}


def test_every_room_must_have_a_layer():
    (layers,) = [contract for contract in contracts() if contract["type"] == "layers"]
    assert layers["exhaustive"]
    assert "exhaustive_ignores" not in layers


def test_a_new_method_and_a_new_room_are_covered_by_being_there(tmp_path):
    for folder in ("src", "data_modules", "callbacks"):
        kept = shutil.ignore_patterns("__pycache__", "*.js")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=kept)
    shutil.copyfile(ROOT / "pyproject.toml", tmp_path / "pyproject.toml")
    planted = {
        "methods/planted": "from cospeech.methods.trimodal import Trimodal",
        "planted_room": "import omegaconf",
        "studies/planted.py": "import cospeech.methods.planted",
    }
    for path, text in planted.items():
        file = tmp_path / "src/cospeech" / path
        file = file if file.suffix else file / "__init__.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text + "\n")
    done = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    said = " ".join(done.stdout.split())
    assert "cospeech.methods.planted is not allowed to import cospeech.methods.trimodal" in said
    assert "cospeech.planted_room is not allowed to import omegaconf" in said
    assert "cospeech.studies is not allowed to import cospeech.methods.planted" in said
    assert "not listed as layers: - cospeech.planted_room" in said
