"""Tables beside a corpus: csv as users have it, and splits given as a file."""

import contextlib
import itertools
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech.errors import ContentError, CospeechError, InputFileError
from cospeech.formats.mocap import Take, read_split_list, with_split_list
from cospeech.formats.tables import columns_of, read_table
from cospeech.formats.trinity_offsets import read_offsets
from tests.fabricated.mocap import put_text


@pytest.mark.parametrize(
    "text", ["a,b\n1,2\n", "a;b\r\n\r\n1; 2\r\n", "\ufeffa\tb\n 1\t2", 'a,b\n"1","2"\n']
)
def test_every_spelling_of_a_table(tmp_path, text):
    rows = read_table(put_text(tmp_path / "t.csv", text))
    assert [row.fields for row in rows] == [("a", "b"), ("1", "2")]


def test_rows_know_their_line_and_columns_their_names(tmp_path):
    path = put_text(tmp_path / "t.csv", "Name,x\n\nq,1,2\nr\n")
    header, first, second = read_table(path)
    assert [row.place for row in (header, first, second)] == ["line 1", "line 3", "line 4"]
    columns = columns_of(header, {"id": ("id", "name")})
    assert first.cell(columns["id"]) == "q"
    with pytest.raises(ContentError, match="1 values where column 2 is wanted") as caught:
        second.cell(1)
    assert caught.value.place == "line 4"
    with pytest.raises(ContentError, match=r"no column 'type'; its columns: Name, x"):
        columns_of(header, {"split": ("type", "split")})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\n,\n,,\n", "is empty"),
        (b"a,b\0c\n", "holds NUL"),
        (b"a,\xff\xfe\n", "is not UTF-8"),
        (b"a," + b"x" * 200_000 + b"\n", "is not a csv table"),
        (b"a,b\n" * 1_500_000, "too long for a table"),
    ],
)
def test_hostile_tables_are_refused(tmp_path, content, message):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=message):
        read_table(path)
    with pytest.raises(InputFileError, match="can't be read"):
        read_table(tmp_path / "absent.csv")


BEAT2 = """id,type
2_scott_0_1_1,test
2_scott_0_9_9,train
2_scott_0_57_57,val
1_wayne_0_1_1,additional
"""


def test_the_list_of_beat2(tmp_path):
    path = put_text(tmp_path / "train_test_split.csv", BEAT2)
    assert read_split_list(path) == {
        "2_scott_0_1_1": "test",
        "2_scott_0_9_9": "train",
        "2_scott_0_57_57": "val",
        "1_wayne_0_1_1": None,
    }


def test_a_folder_of_text_files(tmp_path):
    put_text(tmp_path / "train.txt", "a\nb\n")
    put_text(tmp_path / "dev.txt", "c\n")
    put_text(tmp_path / "test.txt", "d\n")
    put_text(tmp_path / "readme.txt", "not a list")
    assert read_split_list(tmp_path) == {"a": "train", "b": "train", "c": "val", "d": "test"}


def test_broken_lists_name_the_line(tmp_path):
    path = put_text(tmp_path / "s.csv", "id,split\na,train\na,test\n")
    with pytest.raises(InputFileError, match=r"line 3: a is in train and in test"):
        read_split_list(path)
    path = put_text(tmp_path / "s.csv", "id,split\na,trian\n")
    with pytest.raises(InputFileError, match=r"line 2: a is of type 'trian'"):
        read_split_list(path)
    with pytest.raises(InputFileError, match=r"has no train\.txt"):
        read_split_list(tmp_path)


def test_takes_get_the_split_of_the_list(tmp_path):
    path = put_text(tmp_path / "s.csv", "id,split\na,train\nb,val\nzz,test\n")
    takes = [Take(name, "x", tmp_path / f"{name}.bvh", split="test") for name in "abc"]
    listed = with_split_list(takes, path)
    assert [take.split for take in listed] == ["train", "val", None]
    assert listed[0].files == (tmp_path / "a.bvh", path)
    with pytest.raises(CospeechError, match="names none of the 1 recordings"):
        with_split_list(takes[2:], path)


_CELLS = st.one_of(
    st.text(max_size=8),
    st.sampled_from(["id", "type", "train", "Take", "AudioStart", "MotionStart", "offset", "nan"]),
    st.floats().map(repr),
    st.integers(-(10**12), 10**12).map(str),
)


@settings(max_examples=400, deadline=None)
@given(
    st.one_of(
        st.binary(max_size=300),
        st.lists(st.lists(_CELLS, max_size=8).map(",".join), max_size=6).map(
            lambda lines: "\n".join(lines).encode("utf-8", "replace")
        ),
    )
)
def test_whatever_a_table_holds_it_is_read_or_refused(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    with contextlib.suppress(InputFileError):
        assert all(any(row.fields) for row in read_table(path))
    with contextlib.suppress(InputFileError):
        assert {*read_split_list(path).values()} <= {"train", "val", "test", None}
    with contextlib.suppress(InputFileError):
        excerpts = itertools.chain(*read_offsets(path).excerpts.values())
        starts = [time for one in excerpts for time in (one.motion_start, one.audio_start)]
        assert all(0 <= start < float("inf") for start in starts)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "t.csv")
    with pytest.raises(InputFileError, match="it is not a file"):
        read_table(tmp_path / "t.csv")
