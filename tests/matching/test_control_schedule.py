"""Schedules of controls as files and plain values."""

import json
import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.matching import control
from cospeech.matching.control import Controls, parse_criterion, read_controls

ENTRIES = [
    {"to_s": 10, "where": "left_wrist_height >= p85"},
    {"from_s": 10.5, "where": "speed <= p15"},
    {"from_s": 2, "to_s": 4, "where": "asymmetry > 0.1"},
    {"word": "big|huge", "where": "hands_distance > p80"},
    {"word": "big|huge"},
]


def check(controls, when_empty="ignore"):
    assert [(span.from_s, span.to_s) for span in controls.spans] == [
        (0.0, 10.0),
        (10.5, math.inf),
        (2.0, 4.0),
    ]
    assert controls.spans[1].where == parse_criterion("speed <= p15")
    assert [keyword.word.text for keyword in controls.keywords] == ["big|huge"] * 2
    texts = [keyword.where.text for keyword in controls.keywords]
    assert texts == ["hands_distance > p80", 'word("big|huge")']
    assert controls.when_empty == when_empty


def test_all_forms_are_the_same(tmp_path):
    check(Controls.from_dict(ENTRIES))
    whole = {"controls": ENTRIES, "when_empty": "previous"}
    check(Controls.from_dict(whole), "previous")
    for name, text in (("c.json", json.dumps(whole)), ("c.yaml", yaml.safe_dump(whole))):
        (tmp_path / name).write_text(text)
        check(read_controls(tmp_path / name), "previous")
    for one in ("speed > 1", ["speed > 1"], {"where": "speed > 1"}, [{"where": "speed > 1"}]):
        (span,) = Controls.from_dict(one).spans
        assert (span.where.text, span.from_s, span.to_s) == ("speed > 1", 0.0, math.inf)
    assert Controls.from_dict({"controls": []}) == Controls()
    assert Controls.from_dict([{"from_s": None, "where": "speed > 1"}]).spans[0].from_s == 0


def test_the_example_of_the_readme_is_read(tmp_path):
    text = Path(control.__file__).with_name("README.md").read_text()
    example = text.split("```yaml\n")[1].split("```")[0]
    (tmp_path / "c.yaml").write_text(example)
    controls = read_controls(tmp_path / "c.yaml")
    assert len(controls.spans) >= 2
    assert len(controls.keywords) >= 2
    criteria = text.split("## Criteria\n\n```\n")[1].split("```")[0].strip().split("\n")
    assert len(criteria) == 6
    for line in criteria:
        parse_criterion(line)
    for name in control.QUANTITIES:
        assert f"`{name}`" in text or name.replace("right_", "left_") in text


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([ENTRIES[0], {"were": "speed > 1"}], "control 2 has a key 'were'; did you mean 'where'"),
        ([{"from": 3, "where": "speed > 1"}], "control 1 has a key 'from'.*from_s, to_s, where"),
        ([{"word": "big", "from_s": 3}], "control 1 has a key 'from_s'.*word, where"),
        ([{1: 2}], "control 1 has a key 1"),
        ([{"from_s": 3}], "control 1 has no criterion"),
        ([{"where": None}], "control 1, where: a criterion is a text"),
        ([{"where": 3}], "control 1, where"),
        ([{"where": "sped > 1"}], "control 1, where: in the criterion 'sped > 1', character 1"),
        ([{"word": "(?=a)"}], "control 1, word: the pattern"),
        ([{"word": True}], "control 1, word: True is not a text"),
        ([{"word": "big", "where": "big"}], "control 1, where"),
        ([{"from_s": 5, "to_s": 5, "where": "speed > 1"}], "control 1 ends before it begins"),
        ([{"from_s": -1, "where": "speed > 1"}], "control 1, from_s: -1 is not a time"),
        ([{"to_s": "3", "where": "speed > 1"}], "control 1, to_s: '3' is not a time"),
        ([{"to_s": True, "where": "speed > 1"}], "control 1, to_s: True is not a time"),
        ([{"to_s": math.nan, "where": "speed > 1"}], "control 1, to_s: nan is not a time"),
        ([{"to_s": 10**400, "where": "speed > 1"}], "control 1, to_s: 1000"),
        ([3], "control 1 is 3, not a mapping"),
        ({"control": []}, "the controls has a key 'control'; did you mean 'controls'"),
        ({"controls": [], "when_empty": "igno"}, "'igno' is not one of ignore, previous, error"),
        (3, "controls are a list"),
        ([{"where": "speed > 1"}] * 1001, "more than 1000"),
    ],
)
def test_errors_name_the_entry(values, message):
    with pytest.raises(ConfigError, match=message):
        Controls.from_dict(values)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("c.yaml", b"", "is empty"),
        ("c.yaml", b"a: [", "not valid yaml"),
        ("c.yaml", b"\xff\xfe\x00", "not a schedule of controls"),
        ("c.yaml", b"!!python/object/apply:os.system [ls]", "yaml tag"),
        ("c.yaml", b"a: &x [1]\nb: *x", "aliases"),
        ("c.yaml", b"3", "no list of controls"),
        ("c.yaml", b"- " + b"[" * 100_000, "nested more than 20"),
        ("c.yaml", b"- " * 100_000, "nested more than 20"),
        ("c.yaml", b"#" * 300_000, "too long"),
        ("c.json", b"{", "not valid JSON"),
        ("c.json", b"[" * 100_000, "nested too deep"),
        ("c.yaml", b"- {where: sped > 1}", "c.yaml: control 1, where"),
    ],
)
def test_files_that_are_no_schedules(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CospeechError, match=message):
        read_controls(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputFileError, match="can't be read"):
        read_controls(tmp_path / "none.yaml")


_PLAIN = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["where", "from_s", "to_s", "word", "controls", "when_empty", "x"]),
            inner | st.just("speed > p50"),
            max_size=4,
        )
    ),
    max_leaves=8,
)


@given(_PLAIN)
def test_any_values_are_controls_or_an_error(values):
    try:
        controls = Controls.from_dict(values)
    except ConfigError:
        return
    assert all(0 <= span.from_s < span.to_s for span in controls.spans)


def test_one_expression_is_enough():
    alone, within = Controls.from_dict("speed > 1"), Controls.from_dict({"controls": "speed > 1"})
    assert alone == within
    assert [span.where.text for span in alone.spans] == ["speed > 1"]
