"""The door for foreign files: what it gives, and that nothing but documented errors comes out."""

import os
import time
import tracemalloc

import numpy as np
import pytest

from cospeech.errors import ContentError, CospeechError, InputFileError
from cospeech.foreign import (
    linear_pattern,
    open_array,
    parse_json,
    parse_json_stream,
    parse_yaml,
    read_bytes,
    read_json,
    understood,
)


@pytest.mark.parametrize(
    "error", [ValueError("x"), IndexError(), OverflowError(), RecursionError(), MemoryError()]
)
def test_whatever_is_raised_inside_names_the_file(error: Exception) -> None:
    with (
        pytest.raises(InputFileError, match=r"some\.file.*a joint map"),
        understood("some.file", "a joint map"),
    ):
        raise error


def test_what_is_wrong_with_a_content_is_told_with_the_file_and_no_other_cause() -> None:
    with pytest.raises(InputFileError) as caught, understood("f", "x", "another hint"):
        raise ContentError("is odd", "line 2", "mend it")
    assert str(caught.value) == "f, line 2: is odd\n  -> mend it"
    assert caught.value.__cause__ is None


def test_our_own_errors_and_a_stop_by_the_user_come_out_as_they_are() -> None:
    mine = CospeechError("mine")
    with pytest.raises(CospeechError) as caught, understood("f", "x"):
        raise mine
    assert caught.value is mine
    with pytest.raises(KeyboardInterrupt), understood("f", "x"):
        raise KeyboardInterrupt


def test_files_that_never_end_and_long_ones_are_refused(tmp_path) -> None:
    with pytest.raises(InputFileError, match="it is not a file"):
        read_bytes("/dev/zero", "a record", 10)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputFileError, match="it is not a file"):
        read_bytes(tmp_path / "pipe", "a record", 10)
    (tmp_path / "long").write_bytes(b"x" * 11)
    with pytest.raises(InputFileError, match="too long for a record"):
        read_bytes(tmp_path / "long", "a record", 10)
    assert read_bytes(tmp_path / "long", "a record", 11) == b"x" * 11
    with pytest.raises(InputFileError, match="No such file"):
        read_bytes(tmp_path / "absent", "a record", 10)


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "1" * 400, "1" * 5000, "-" + "9" * 31])
def test_json_that_is_refused(text: str) -> None:
    with pytest.raises(InputFileError, match=r"a\.json"):
        parse_json("a.json", text, "a record")


def test_json_values(tmp_path) -> None:
    assert parse_json("a", '{"a": ["\\ud800x", 1.5, null]}', "x") == {"a": ["\ufffdx", 1.5, None]}
    assert parse_json("a", '"\\ud83d\\ude00"', "x") == "\U0001f600"
    long_text = "1" * 64
    assert parse_json("a", f'["{long_text}", 0.{long_text}]', "x")[0] == long_text
    (tmp_path / "b.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "b.json", "x") == [1]


@pytest.mark.parametrize(
    "text",
    [
        "a: &x [1]\nb: *x",
        "a: !!python/object/apply:os.system [ls]",
        "a: !!timestamp 2001-99-99",
        "a: 2001-99-99",
        "a: 2001-02-03",
        "a: !!int 3",
        "[" * 50,
        "[" * 30 + "]" * 30,
        "a: " + "9" * 400,
        "a: " + ":".join(["1"] * 200),
        "a: b: c",
        "\x00",
    ],
)
def test_yaml_that_is_refused(text: str) -> None:
    with pytest.raises(InputFileError, match=r"a\.yaml"):
        parse_yaml("a.yaml", text, "a joint map")


def test_yaml_values() -> None:
    values = parse_yaml("a", "a: [1, 2.5, yes, null, '2021-13-40']\n<<: x", "x")
    assert values == {"a": [1, 2.5, True, None, "2021-13-40"], "<<": "x"}


def test_patterns_take_time_in_proportion_to_the_text() -> None:
    started = time.process_time()
    assert linear_pattern("(a*)*b").fullmatch("a" * 20_000) is None
    assert linear_pattern("(|a|a)" * 30).search("b" * 1000) is not None
    assert time.process_time() - started < 5  # a backtracking engine needs longer than the universe
    assert linear_pattern(r"_(?P<speaker>[a-z]+)_").search("2_scott_0")["speaker"] == "scott"
    assert linear_pattern("É|x", ignore_case=True).fullmatch("é") is not None


@pytest.mark.parametrize(
    ("text", "fitting", "other"),
    [
        (r"\w+", "Jörg", "J\udcf6rg"),
        (r"\d+\D", "٣x", "ab"),
        (r"\W", "¡", "ö"),
        (r"[^\w:]+", "-", "ö"),
        (r"[[:digit:]\w]+", "1ö", "-"),
        (r"[]\w]+", "]ö", "-"),
        (r"\[\w\]", "[ö]", "ö"),
    ],
)
def test_classes_of_a_pattern_are_of_every_alphabet(text, fitting, other) -> None:
    assert linear_pattern(text).fullmatch(fitting) is not None
    assert linear_pattern(text).fullmatch(other) is None


@pytest.mark.parametrize("text", ["(", r"(a)\1", "(?=a)", "a{100000}", "[z-a]"])
def test_patterns_that_are_refused(text: str) -> None:
    with pytest.raises(CospeechError, match="no regular expression"):
        linear_pattern(text)


def test_no_terminal_obeys_what_a_message_quotes() -> None:
    error = InputFileError("a\nerror: b\x1b]0;c\x07", "d\u202e\ud800", hint="e\x1b[2J")
    assert str(error) == "a error: b\ufffd]0;c\ufffd: d\ufffd\ufffd\n  -> e\ufffd[2J"


def test_texts_of_far_too_many_values_are_refused() -> None:
    for many in ("[" + "[]," * 600_000 + "[]]", "[" + "{}," * 600_000 + "{}]"):
        with pytest.raises(InputFileError, match="too large for a record"):
            parse_json("a.json", many, "a record")
        with pytest.raises(ContentError, match="too large for a record"):
            parse_json_stream(many, "a record")
    with pytest.raises(ContentError, match="more than 100000 JSON documents"):
        parse_json_stream("1 " * 100_001, "a record")
    with pytest.raises(InputFileError, match="parts of yaml"):
        parse_yaml("a.yaml", "[" + "1," * 15_000 + "]", "a joint map")


def test_an_array_is_mapped_as_it_was_saved(tmp_path) -> None:
    path = tmp_path / "a.npy"
    for values in (np.arange(6, dtype=np.int32).reshape(3, 2), np.zeros((0, 4), np.float32)):
        np.save(path, np.asfortranarray(values))
        found = open_array(path, "an array")
        assert isinstance(found, np.memmap)
        assert found.dtype == values.dtype
        np.testing.assert_array_equal(found, values)


def test_an_array_whose_header_claims_gigabytes_takes_none(tmp_path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.zeros(3))
    whole = path.read_bytes()
    tracemalloc.start()
    for damaged in (
        whole[:6] + b"\x03\x00" + b"v\x00tr" + whole[10:],
        whole[:6] + b"\x02\x00" + b"v\x00tr" + whole[10:],
        whole.replace(b"(3,)", b"(3000000000,)"),
        whole[:40],
        b"",
    ):
        path.write_bytes(damaged)
        with pytest.raises(InputFileError, match=r"a\.npy"):
            open_array(path, "an array", "make it again")
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(InputFileError, match="Python's objects"):
        open_array(path, "an array")
