"""Rooms above the methods ask for capabilities: they name no method and probe no attribute."""

import ast
from pathlib import Path

import pytest

from cospeech.methods import base, capabilities, fitted

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "cospeech"
UPPER = sorted(
    path
    for room in ("experiment", "studies", "reporting", "encoders.py", "evaluation")
    for path in [PACKAGE / room, *(PACKAGE / room).rglob("*.py")]
    if path.suffix == ".py"
) + sorted((ROOT / "callbacks").glob("*.py"))

OPEN_ROOMS = ("cospeech.methods.base", "cospeech.methods.capabilities", "cospeech.methods.fitted")
"""What of the methods may be imported."""

CAPABILITIES = {
    name
    for module in (base, capabilities, fitted)
    for name, value in vars(module).items()
    if isinstance(value, type) and value.__module__ == module.__name__
}

METHODS = {"method", "model", "pl_module", "holder", "module"}
"""What a method is called in these rooms."""


def faults(source: str) -> list[str]:
    """Where a module names a method or a judge, or asks one for anything but a capability."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            names = [str(node.module)]
            if node.module in ("cospeech", "cospeech.methods", "cospeech.judges"):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            found += [f"{node.lineno}: {name}" for name in names if _is_closed(name)]
        elif isinstance(node, ast.Import):
            found += [f"{node.lineno}: {a.name}" for a in node.names if _is_closed(a.name)]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
            asks = node.func.id in ("isinstance", "issubclass")
            probes = node.func.id in ("hasattr", "getattr", "setattr")
            if (asks or probes) and _called(node.args[0]) in METHODS:
                of = {_called(item) for item in ast.walk(node.args[1])} - {None}
                if probes or not of <= {*CAPABILITIES, "DictConfig", "WindowReader"}:
                    found.append(f"{node.lineno}: {ast.unparse(node)}")
    return found


def _is_closed(name: str) -> bool:
    if name.startswith("cospeech.methods."):
        return not name.startswith(OPEN_ROOMS)
    # A judge's frozen form is a value; what is trained to be one is not asked for by name.
    return name.endswith("phase_classifier.module") or name.startswith(
        "cospeech.judges.motion_autoencoder"
    )


def _called(node: ast.AST) -> str | None:
    if isinstance(node, ast.Name):
        return node.id
    return node.attr if isinstance(node, ast.Attribute) else None


@pytest.mark.parametrize("path", UPPER, ids=lambda path: str(path.relative_to(ROOT)))
def test_upper_rooms_know_no_method(path):
    assert faults(path.read_text()) == []


@pytest.mark.parametrize(
    "source",
    [
        "from cospeech.methods.trimodal import Trimodal",
        "from cospeech.methods import trimodal",
        "import cospeech.methods.motion_matching.matched",
        "from cospeech.judges.motion_autoencoder import MotionAutoencoder",
        "getattr(system.method, 'classifier', None)",
        "hasattr(model, 'steps_left')",
        "isinstance(model, MatchedMethod)",
        "issubclass(run.method, (GestureMethod, Trimodal))",
    ],
)
def test_a_room_that_does_is_found(source):
    assert len(faults(source)) == 1


def test_a_room_that_asks_for_a_capability_is_not():
    source = "from cospeech.methods.capabilities import HasSchedule\nisinstance(model, HasSchedule)"
    assert faults(source) == []
    assert {"GestureMethod", "HasSchedule", "NeedsStore", "FittedWithoutSteps"} <= CAPABILITIES
