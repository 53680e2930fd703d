"""What a user is told to type is, behind the shell and Hydra, what was meant."""

import shlex

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from cospeech.quoting import quoted, setting

LETTERS = ["=", ",", "[x]", "(1)", "{", "}", "ä", "é", "東", "🎉", "'", '"', "#", "!", "&", "\n"]
LETTERS += ["${x}", "\\${x}", "\\", '\\"', "\\\\'", " ", "$", ":", "~", "`", ";", "<", "^"]
WORDS = ["null", "NULL", "True", "inf", "-inf", "nan", "12", "1_000", "1e5", "", "é", "-x", "a-b"]


def read_back(value):
    """What the setting is to a command."""
    (argument,) = shlex.split(setting("data.root", value))
    override = OverridesParser.create().parse_override(argument)
    assert not override.is_sweep_override()
    return OmegaConf.to_container(OmegaConf.create({"value": override.value()}), resolve=True)[
        "value"
    ]


@pytest.mark.parametrize("letter", LETTERS)
@pytest.mark.parametrize("path", ["/my/dir{}ectory", "/my/{}", "{}x", "/a b/{0}{0}, c"])
def test_a_text_of_any_letters_is_that_text(letter, path):
    path = path.format(letter) if "{0}" not in path else path.replace("{0}", letter)
    assert read_back(path) == path


@pytest.mark.parametrize("word", WORDS)
def test_a_word_that_hydra_takes_for_something_else_is_that_text(word):
    assert read_back(word) == word


def test_other_plain_values_are_those_values():
    values = [None, True, 3, -0.25, 1e-7, "12", ["a, b", []], {"go on": "x y", "?": {}, "b": None}]
    assert read_back(values) == values


@pytest.mark.parametrize("key", ["é", "12", "null", "a:b", "", "a ", '"'])
def test_a_key_that_cannot_be_quoted_is_refused(key):
    with pytest.raises(ValueError, match="can't be typed as a key"):
        quoted([{key: 1}])


def test_the_quoting_of_the_readme_is_what_is_suggested():
    assert setting("data.root", "/a, b=c") == """'data.root="/a, b=c"'"""
    assert setting("data.root", "/plain/path") == "data.root=/plain/path"
