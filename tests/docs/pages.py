"""Pages whose code is executed: their files go into a copy of the project, where they are typed."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

PROJECT = Path(__file__).resolve().parents[2]
ADDED = "end of "
"""Begins the title of what is added to a file that is there."""

_BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_PARTS = ("src", "conf", "callbacks", "data_modules", "tests", "pyproject.toml")


class Block(NamedTuple):
    """A piece of code of a page; its title is the file that it belongs to, if any."""

    language: str
    title: str
    code: str


class Page:
    """A page of docs/.

    Attributes:
        blocks: Its code, in order.
    """

    def __init__(self, name: str) -> None:
        text = (PROJECT / "docs" / name).read_text(encoding="utf-8")
        self.blocks = [Block(*found) for found in _BLOCK.findall(text)]

    @property
    def commands(self) -> list[str]:
        """What is typed, a line each."""
        typed = [block.code for block in self.blocks if block.language == "bash"]
        return [line for code in typed for line in code.splitlines()]

    @property
    def files(self) -> list[Block]:
        """What belongs into files; blocks of one file follow one another."""
        return [block for block in self.blocks if block.title]

    def write(self, folder: Path) -> None:
        """Its files, into a checkout or an empty folder."""
        begun = set()
        for _, title, code in self.files:
            path = folder / title.removeprefix(ADDED)
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a" if title.startswith(ADDED) or title in begun else "x") as file:
                file.write(f"\n\n{code}" if file.tell() else code)
            begun.add(title)


def checkout(folder: Path) -> Path:
    """A copy of the project in an empty folder."""
    ignored = shutil.ignore_patterns("__pycache__")
    for name in (*_PARTS, *(path.name for path in PROJECT.glob("*.py"))):
        if (PROJECT / name).is_dir():
            shutil.copytree(PROJECT / name, folder / name, ignore=ignored)
        else:
            shutil.copy2(PROJECT / name, folder / name)
    return folder


def typed(command: str, folder: Path) -> str:
    """What a command prints, typed in a checkout.

    Raises:
        AssertionError: It fails.
    """
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-ec", command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder / "src"), "PATH": programs},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-6000:]}"
    return done.stdout
