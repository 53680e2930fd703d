"""Adversaries of a setting: whose classes are looked up, and with which arguments."""

import sys

import pytest
import torch
from torch import nn

from cospeech.adversarial.losses import LEAST_SQUARES, NON_SATURATING
from cospeech.adversarial.settings import SettableAdversary, checked_settings
from cospeech.errors import ConfigError

TOWERS = """
import torch
from cospeech.adversarial.settings import SettableAdversary
class Tower(SettableAdversary):
    @staticmethod
    def network(inputs, floors: int = 2, tilt: float = 0.1, label: str = "x", open: bool = True):
        return torch.nn.Sequential(*(torch.nn.Linear(inputs, inputs) for _ in range(floors)))
class Thing:
    network = None
def tower(*_, **__):
    raise SystemExit
"""


class Plain(SettableAdversary):
    @staticmethod
    def network(inputs, hidden: int = 3, dropout: float = 0.3):
        return nn.Linear(inputs, hidden)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A package of a user, with a method and an adversary, and another with a trap."""
    for package, text in (("homegrown", TOWERS), ("stranger", "raise SystemExit")):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
        (tmp_path / package / "towers.py").write_text(text)
        (tmp_path / package / "__main__.py").write_text("raise SystemExit")
    (tmp_path / "homegrown" / "method.py").write_text("class Method: pass")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.split(".")[0] in ("homegrown", "stranger")]:
        del sys.modules[name]


def checked(settings, *methods):
    return checked_settings(settings, {"plain": Plain}, SettableAdversary, methods)


def homegrown(settings):
    import homegrown.method

    return checked(settings, homegrown.method.Method)


def test_a_built_in_one_takes_its_defaults():
    (found,) = checked({"plain": {"weight": 2}}).values()
    assert found.arguments == {
        "weight": 2, "loss": "non_saturating", "hidden": 3, "dropout": 0.3
    }  # fmt: skip
    adversary = found.build(5)
    assert (adversary.weight, adversary.losses) == (2, NON_SATURATING)
    assert adversary.discriminator(torch.zeros(1, 5)).shape == (1, 3)
    (other,) = checked({"plain": {"weight": 0, "loss": "least_squares", "hidden": 4.0}}).values()
    assert other.build(5).losses is LEAST_SQUARES
    assert other.identity()["hidden"] == 4


def test_one_of_your_own_is_found_beside_your_method(folder):
    node = {"class": "homegrown.towers.Tower", "weight": 1, "floors": 3, "open": False}
    found = homegrown({"tower": node, "plain": {"weight": 1}, "second": node})
    assert list(found) == ["plain", "tower", "second"]
    assert len(found["tower"].build(2).discriminator) == 3
    assert found["tower"].identity() == {
        "class": "homegrown.towers.Tower", "loss": "non_saturating", "floors": 3, "tilt": 0.1,
        "label": "x", "open": False,
    }  # fmt: skip


@pytest.mark.parametrize(
    "path",
    [
        "stranger.towers.Tower", "homegrown_too.towers.Tower", "subprocess.Popen", "os.system",
        "Tower", "", "homegrown..towers.Tower", "homegrown.towers .Tower", "homegrown.__main__.A",
        ".homegrown.towers.Tower", "homegrown.method.\0.Tower", 3, ["homegrown.towers.Tower"],
    ],
)  # fmt: skip
def test_a_class_from_elsewhere_is_refused_and_nothing_of_it_imported(folder, path):
    with pytest.raises(ConfigError, match="is no class of homegrown"):
        homegrown({"tower": {"class": path, "weight": 1}})
    assert "stranger" not in sys.modules
    assert "homegrown.towers" not in sys.modules


@pytest.mark.parametrize("name", ["Thing", "tower", "torch", "Missing", "SettableAdversary"])
def test_what_is_no_adversary_is_refused_and_not_called(folder, name):
    with pytest.raises(ConfigError, match=f"homegrown.towers.{name} is no subclass of"):
        homegrown({"tower": {"class": f"homegrown.towers.{name}", "weight": 1}})


def test_a_missing_module_is_named(folder):
    with pytest.raises(ConfigError, match=r"homegrown\.tower\.Tower: No module named"):
        homegrown({"tower": {"class": "homegrown.tower.Tower", "weight": 1}})


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ({"tilt": "steep"}, "tilt='steep': not a number"),
        ({"tilt": True}, "tilt=True: not a number"),
        ({"floors": 0}, "floors=0: a whole number from 1"),
        ({"floors": 2.5}, "floors=2.5: a whole number from 1"),
        ({"floors": float("inf")}, "floors=inf: a whole number"),
        ({"label": 3}, "label=3: not like 'x'"),
        ({"open": 1}, "open=1: not like True"),
        ({"weight": float("nan")}, "weight=nan: must not be negative"),
        ({"color": 1}, "color: no such setting; there are weight, loss, floors, tilt"),
    ],
)
def test_values_are_like_the_defaults(folder, node, message):
    with pytest.raises(ConfigError, match=message):
        homegrown({"tower": {"class": "homegrown.towers.Tower", "weight": 1, **node}})


def test_wrong_names_and_missing_weights_are_said_with_what_to_do():
    for name in ("keys", "a.b", "two words"):
        with pytest.raises(ConfigError, match="can't be called so"):
            checked({name: {"weight": 1}})
    with pytest.raises(ConfigError, match="no such adversary; there are plain") as caught:
        checked({"tower": {"weight": 1}})
    assert "class=PACKAGE.MODULE.CLASS" in caught.value.hint
    with pytest.raises(ConfigError, match="plain has no weight"):
        checked({"plain": {}})
