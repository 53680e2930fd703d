"""What messages, comments and READMEs tell a user to type: found in the sources, and looked up."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = ("train", "evaluate", "prepare", "generate")
CODE = ("src", "data_modules", "callbacks")

SETTING = re.compile(
    r"(?<![\w./$<{*=-])(?P<key>\+{0,2}[a-z_][a-z0-9_]*(?:\.[a-z_][a-z0-9_]*)*)=(?![=\s])"
    r"(?P<value>[^\s`'\",;)\]}|]*)"
)
SCRIPT = re.compile(
    r"python (?P<script>\w+)\.py\b"
    r"(?P<rest>(?:\s+(?:\[?[-+~\w./]+=[^\s),;:`]*|--?[a-z]\S*|\.\.\.))*)"
)
CALL = re.compile(r"(?P<callee>\w+)\((?P<arguments>[^()]*)\)|\bpass (?P<passed>[^()]*)")
"""Keyword arguments in Python: of a call, or what a hint for Python callers says to pass."""
MODULE = re.compile(r"python -m (?P<module>cospeech[\w.]*)(?P<rest>[^\n`]*)")
EXTRA = re.compile(r"pip install[^\n`]*\.\[(?P<extras>[\w,]+)\]")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
TREE = re.compile(
    r"(?<![\w./-])(?:conf|docs|src|tests|benchmarks|data_modules|callbacks)/[\w./*-]+"
)
TARGET = re.compile(r"^make (?P<target>[a-z]+)", re.MULTILINE)
NAMES = frozenset({"key", "name", "group", "group.name"})
"""What stands for the name of a setting."""
PLACEHOLDER = re.compile(r"|\.\.\..*|[A-Z_]+|.*[%{*(].*|true|false|null")
"""Values that stand for one of the user's, or are no name of a choice."""


@dataclass(frozen=True)
class Text:
    """A piece of text that a user may read.

    Attributes:
        place: File and line.
        text: The text; what an f-string puts in is ``{}``.
        is_hint: Whether it is the next step of an error, so that what it names is typed.
    """

    place: str
    text: str
    is_hint: bool


# What there is to read -------------------------------------------------------------------------


def texts(root: Path = ROOT) -> Iterator[Text]:
    """Every string of the package, comment of a yaml, and code of a README."""
    for path in code_files(root):
        yield from _texts_of(parsed(path), str(path.relative_to(root)))
    for path in sorted((root / "conf").rglob("*.yaml")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            _, mark, comment = line.partition("#")
            if mark and "@package" not in comment:
                yield Text(f"{path.relative_to(root)}:{number}", comment, False)
    for path in [root / "README.md", *(root / "docs").rglob("*.md"), *(root / "src").rglob("*.md")]:
        content = path.read_text()
        for found in re.finditer(r"```(\w*)\n(.*?)```|`([^`\n]+)`", content, re.DOTALL):
            if found[1] not in ("python", "yaml"):
                line = content[: found.start()].count("\n") + 1
                yield Text(f"{path.relative_to(root)}:{line}", found[2] or found[3] or "", False)


def code_files(root: Path = ROOT) -> list[Path]:
    found = [path for folder in CODE for path in (root / folder).rglob("*.py")]
    return sorted([*found, *(root / f"{name}.py" for name in COMMANDS)])


@cache
def parsed(path: Path) -> list[ast.AST]:
    """Every node of a module, those above before those below."""
    return list(ast.walk(ast.parse(path.read_text())))


def texts_of_code(source: str, name: str) -> Iterator[Text]:
    """The strings of a module; adjacent and formatted ones as one."""
    return _texts_of(list(ast.walk(ast.parse(source))), name)


def _texts_of(nodes: list[ast.AST], name: str) -> Iterator[Text]:
    hints = {id(node) for call in nodes for node in _hints(call)}
    inside = set[int]()
    for node in nodes:
        if isinstance(node, ast.JoinedStr | ast.BinOp) or id(node) in hints:
            text = _text(node)
            inside |= {id(child) for child in ast.walk(node) if child is not node}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        else:
            continue
        if id(node) not in inside and text:
            yield Text(f"{name}:{node.lineno}", text, id(node) in hints)


def _text(node: ast.AST) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(value) for value in node.values)
    if isinstance(node, ast.FormattedValue):
        return _text(node.value) if isinstance(node.value, ast.Call) else "{}"
    if isinstance(node, ast.Call):
        named = getattr(node.func, "id", "") == "setting" and _text(node.args[0])
        return f"{named or ''}{'=' if named else ''}{{}}"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left) + _text(node.right)
    if isinstance(node, ast.IfExp):
        return f"{_text(node.body)} {_text(node.orelse)}"
    return ""


_HINT_POSITION = {
    "CospeechError": 1,
    "ConfigError": 1,
    "InputFileError": 3,
    "ContentError": 2,
    "understood": 2,
    "Finding": 5,
}


def _hints(call: ast.AST) -> Iterator[ast.AST]:
    """The expressions of a call that are somebody's next step."""
    if not isinstance(call, ast.Call):
        return
    name = getattr(call.func, "id", getattr(call.func, "attr", ""))
    position = _HINT_POSITION.get(name)
    if position is not None and len(call.args) > position:
        yield call.args[position]
    yield from (word.value for word in call.keywords if word.arg in ("hint", "next_step"))


# What there is ----------------------------------------------------------------------------------


class Known:
    """Settings, choices, arguments, options and files of a source tree."""

    def __init__(self, root: Path = ROOT) -> None:
        self.root = root
        groups = [path for path in (root / "conf").iterdir() if path.is_dir()]
        self.choices = {
            path.name: {file.stem for file in path.glob("*.yaml")} - {"base"} for path in groups
        }
        own = {name: _keys(root / "conf" / f"{name}.yaml") for name in COMMANDS}
        shared = set().union(*(_group_keys(path) for path in groups))
        self.settings = {
            name: own[name] | self.groups(name) | {key for key in shared if self._has(name, key)}
            for name in COMMANDS
        }
        nodes = [node for path in code_files(root) for node in parsed(path)]
        self.parameters = {
            argument.arg
            for node in nodes
            if isinstance(node, ast.arguments)
            for argument in [*node.args, *node.kwonlyargs]
        } | {
            node.target.id  # fields of dataclasses
            for node in nodes
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
        }
        project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
        self.functions = {
            node.name: {item.arg for item in [*node.args.args, *node.args.kwonlyargs]}
            for node in nodes
            if isinstance(node, ast.FunctionDef) and node.args.kwarg is None
        }
        makefile = (root / "Makefile").read_text()
        self.targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
        self.every_option = set().union(
            *(
                re.findall(r"\"(--[a-z-]+)\"", path.read_text())
                for path in [*code_files(root), *(root / "benchmarks").glob("*.py")]
            )
        )
        self.scripts = {path.stem for path in (root / "benchmarks").rglob("*.py")}
        self.extras = set(project["optional-dependencies"])

    def groups(self, command: str) -> set[str]:
        """Groups that a command has."""
        defaults = _loaded(self.root / "conf" / f"{command}.yaml")["defaults"]
        names = {str(next(iter(item))) for item in defaults if isinstance(item, dict)}
        return {name for name in names if not name.startswith(("optional ", "override "))}

    def _has(self, command: str, key: str) -> bool:
        group = key.partition(".")[0]
        return group in self.groups(command) or group not in self.choices

    def options(self, module: str) -> set[str]:
        """Options of a module that runs, as its source adds them."""
        return set(re.findall(r"\"(--[a-z-]+)\"", self.source(module))) | {"--help"}

    def subcommands(self, module: str) -> set[str]:
        """Commands of a module that runs."""
        return set(re.findall(r"add_parser\(\s*\"(\w+)\"", self.source(module)))

    def source(self, module: str) -> str:
        """Of what ``python -m`` runs; empty where it is nothing."""
        path = self.root / "src" / Path(*module.split("."))
        file = path / "__main__.py" if path.is_dir() else path.with_suffix(".py")
        source = file.read_text() if file.is_file() else ""
        return source if "__main__" in source else ""


@cache
def _loaded(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def _keys(path: Path, prefix: str = "") -> set[str]:
    def walk(node: dict[str, Any], above: str) -> Iterator[str]:
        for key, value in node.items():
            yield f"{above}{key}"
            if isinstance(value, dict):
                yield from walk(value, f"{above}{key}.")

    found = set(walk(_loaded(path) or {}, prefix))
    return found - {f"{prefix}defaults"}


def _group_keys(folder: Path) -> set[str]:
    found = set[str]()
    for path in folder.glob("*.yaml"):
        is_global = "@package _global_" in path.read_text()
        found |= _keys(path, "" if is_global else f"{folder.name}.")
    return found


# Looking up -------------------------------------------------------------------------------------


def faults(text: Text, known: Known) -> list[str]:
    """What a text tells to type and doesn't exist."""
    found = list[str]()
    if not any(mark in text.text for mark in ("=", "python ", "--", "/", "make ", "pip ")):
        return found
    for command in SCRIPT.finditer(text.text):
        if command["script"] in COMMANDS:
            found += _settings(command["rest"], known, {command["script"]}, frozenset())
        elif command["script"] not in known.scripts:
            found.append(f"there is no {command['script']}.py")
    rest = SCRIPT.sub(" ", text.text)
    for command in MODULE.finditer(rest):
        found += _module(command["module"], command["rest"], known)
    rest = MODULE.sub(" ", rest)
    for call in CALL.finditer(rest):
        arguments = call["arguments"] or call["passed"] or ""
        takes = known.functions.get(call["callee"] or "", known.parameters)
        found += _settings(arguments, known, set(COMMANDS), takes)
    rest = CALL.sub(" ", rest)
    takes = frozenset[str]() if text.is_hint else known.parameters
    found += _settings(rest, known, set(COMMANDS), takes)
    if text.is_hint:
        lacking = set(OPTION.findall(rest)) - known.every_option - {"--help"}
        found += [f"there is no option {name}" for name in sorted(lacking)]
    for match in EXTRA.finditer(text.text):
        lacking = set(match["extras"].split(",")) - known.extras
        found += [f"there is no extra {name}" for name in sorted(lacking)]
    found += [
        f"there is no make {match['target']}"
        for match in TARGET.finditer(text.text)
        if match["target"] not in known.targets
    ]
    return found + _files(text, known)


def _files(text: Text, known: Known) -> list[str]:
    beside = (known.root / text.place.partition(":")[0]).parent
    return [
        f"there is no {match[0]}"
        for match in TREE.finditer(text.text)
        if "NAME" not in match[0]
        and not any(list(folder.glob(match[0].rstrip("./"))) for folder in (known.root, beside))
    ]


def _module(module: str, rest: str, known: Known) -> list[str]:
    if not known.source(module):
        return [f"{module} does not run"]
    found = [f"{module} has no {o}" for o in OPTION.findall(rest) if o not in known.options(module)]
    words, commands = rest.split(), known.subcommands(module)
    if commands and words and re.fullmatch("[a-z]+", words[0]) and words[0] not in commands:
        found.append(f"{module} has no command {words[0]}")
    return found


def _settings(words: str, known: Known, commands: set[str], takes: AbstractSet[str]) -> list[str]:
    """Settings that none of the commands has, and that are no arguments either."""
    if "=" not in words:
        return []
    settings = set().union(*(known.settings[name] for name in commands))
    found = list[str]()
    for match in SETTING.finditer(words):
        key, value = match["key"].lstrip("+"), match["value"].rstrip(".:")
        if key in NAMES or key.startswith(("_", "hydra.")) or _is_markup(words, match):
            continue
        if key in known.choices:
            if key not in settings or not _chooses(value, known.choices[key]):
                found.append(f"{match[0]}: no such choice")
        elif key in settings:
            continue
        elif "." in key:
            if not (match["key"].startswith("+") and key.partition(".")[0] in known.choices):
                found.append(f"{match[0]}: no such setting")
        elif key not in takes:
            found.append(f"{match[0]}: no such setting")
    return found


def _is_markup(words: str, match: re.Match[str]) -> bool:
    """An attribute of HTML or SVG, whose value is in quotes right behind."""
    return (
        "." not in match["key"]
        and words[match.end("key") + 1 :][:1] in ('"', "'")
        and ("<" in words or not match["value"])
    )


def _chooses(value: str, group: set[str]) -> bool:
    names = re.split(r"[,|/]", value)
    return all(name in group or PLACEHOLDER.fullmatch(name) for name in names)
