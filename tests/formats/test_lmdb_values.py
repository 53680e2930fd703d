"""LMDB databases of serialised values, found without the lmdb library and compared with it."""

import random
import struct
from pathlib import Path

import lmdb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech.errors import InputFileError
from cospeech.formats.lmdb_file import data_file, find_values
from cospeech.formats.lmdb_values import list_keys, read_value
from tests.fabricated.legacy_arrow_writer import write_legacy_arrow
from tests.fabricated.lmdb_database import write_lmdb

MAIN_FLAGS = 16 + 24 + 48 + 4
"""Place of the unnamed database's flags in a meta page; its depth follows."""
SAMPLE = {"vid": "a", "poses": np.arange(6.0).reshape(2, 3)}


def as_lmdb_reads(folder):
    """Every key and value by the lmdb library, which trusts the file."""
    with (
        lmdb.open(str(folder), readonly=True, lock=False) as database,
        database.begin() as transaction,
    ):
        return list(transaction.cursor())


def as_we_read(path):
    values = find_values(path)
    return [(key, values.read(key)) for key in values.places]


@pytest.mark.parametrize("name", ["lmdb_train", "lmdb_val", "lmdb_val_cache", "lmdb_expressive"])
def test_genuine_databases_equal_what_lmdb_reads(shared, name):
    folder = shared / "data" / "ted_legacy_fixture" / name
    assert as_we_read(folder) == as_lmdb_reads(folder)


def test_keys_have_gaps_and_values_are_decoded(shared):
    folder = shared / "data" / "ted_legacy_fixture" / "lmdb_train"
    assert list_keys(folder) == [b"0000000000", b"0000000002", b"0000000003"]
    video = read_value(folder, b"0000000002")
    assert video["vid"] == "synthTED_02"
    assert len(video["clips"]) == 3


def test_folder_and_file_are_the_same(tmp_path):
    folder = write_lmdb(tmp_path / "db", {b"k": write_legacy_arrow(SAMPLE)})
    assert data_file(folder) == data_file(folder / "data.mdb") == folder / "data.mdb"
    assert list_keys(str(folder)) == list_keys(folder / "data.mdb") == [b"k"]
    np.testing.assert_array_equal(read_value(folder, b"k")["poses"], SAMPLE["poses"])


SIZES = st.sampled_from([0, 1, 100, 2000, 2040, 4080, 4081, 50_000])
ENTRIES = st.dictionaries(st.binary(min_size=1, max_size=40), SIZES, max_size=20)


@given(ENTRIES, ENTRIES)
@settings(max_examples=40, deadline=None)
def test_any_database_reads_as_with_lmdb(tmp_path_factory, first, second):
    """Short and long values in two transactions, some of them deleted again."""
    folder = tmp_path_factory.mktemp("db")
    for entries, filling in ((first, b"1"), (second, b"2")):
        write_lmdb(folder, {key: filling * size for key, size in entries.items()})
    with lmdb.open(str(folder), map_size=2**24) as database, database.begin(write=True) as writing:
        for key in list(first)[::3]:
            writing.delete(key)
    wanted = as_lmdb_reads(folder)
    assert len(wanted) == len((set(first) | set(second)) - set(list(first)[::3]))
    assert as_we_read(folder) == wanted


def test_tree_of_three_levels(tmp_path):
    values = {b"%0100d" % number: b"v%d" % number for number in range(3000)}
    folder = write_lmdb(tmp_path / "db", values)
    assert as_we_read(folder) == sorted(values.items())
    content = (folder / "data.mdb").read_bytes()
    assert struct.unpack_from("<H", content, 4096 + MAIN_FLAGS + 2) == (3,)


def test_rewritten_database_is_read_again(tmp_path):
    folder = write_lmdb(tmp_path / "db", {b"a": b"1"})
    assert list_keys(folder) == [b"a"]
    write_lmdb(folder, {b"b": b"2" * 5000})
    assert list_keys(folder) == [b"a", b"b"]


def test_empty_database(tmp_path):
    assert list_keys(write_lmdb(tmp_path / "db", {})) == []


def test_damaged_value_names_database_key_and_offset(tmp_path):
    whole = write_legacy_arrow(SAMPLE)
    folder = write_lmdb(tmp_path / "db", {b"0000000004": whole[:1000], b"0000000005": whole})
    with pytest.raises(InputFileError, match=r"key 0000000004, byte \d+ of the value: ") as raised:
        read_value(folder, b"0000000004")
    assert raised.value.path == folder / "data.mdb"
    assert read_value(folder, b"0000000005")["vid"] == "a"


def test_unknown_key(tmp_path):
    folder = write_lmdb(tmp_path / "db", {b"a": b"1"})
    with pytest.raises(InputFileError, match="no key b'b'"):
        read_value(folder, b"b")


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({}, "the folder has no data.mdb"),
        ({"lock.mdb": b""}, "a lock.mdb but no data.mdb"),
        ({"data.mdb": b""}, "too few for an LMDB file"),
        ({"data.mdb": bytes(100)}, "too few for an LMDB file"),
        ({"data.mdb": bytes(10_000)}, "isn't an LMDB file"),
        ({"data.mdb": b"<!DOCTYPE html>" * 1000}, "isn't an LMDB file"),
    ],
)
def test_folders_without_a_database(tmp_path, files, reason):
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputFileError, match=reason):
        list_keys(tmp_path)


def test_missing_path(tmp_path):
    with pytest.raises(InputFileError, match="no such LMDB folder or file"):
        list_keys(tmp_path / "absent")


def test_other_kinds_of_databases_are_refused(tmp_path):
    with lmdb.open(str(tmp_path / "named"), max_dbs=2) as database:
        database.open_db(b"inner")
    with pytest.raises(InputFileError, match="named databases"):
        list_keys(tmp_path / "named")
    several = bytearray(published(tmp_path / "db").read_bytes())
    for page in (0, 4096):
        several[page + MAIN_FLAGS] = 4
    (tmp_path / "several.mdb").write_bytes(several)
    with pytest.raises(InputFileError, match="several values per key"):
        list_keys(tmp_path / "several.mdb")


def published(folder):
    """A database with inline and long values in a tree of two levels."""
    values = {
        b"%010d" % number: bytes([number]) * (60 if number % 9 else 3000) for number in range(250)
    }
    return write_lmdb(folder, values) / "data.mdb"


def test_truncated_file_is_refused(tmp_path):
    """The lmdb library maps such a file, and the process dies with SIGBUS."""
    content = published(tmp_path / "db").read_bytes()
    copy = tmp_path / "copy.mdb"
    for length in range(0, len(content) - 4096, 4096 + 1):
        copy.write_bytes(content[:length])
        with pytest.raises(InputFileError, match=r"cut short|too few|goes on"):
            list_keys(copy)


def test_file_cut_after_it_was_opened(tmp_path):
    file = published(tmp_path / "db")
    values = find_values(file)
    file.write_bytes(file.read_bytes()[: 3 * 4096])
    with pytest.raises(InputFileError, match="cut short"):
        values.read(b"%010d" % 243)


def tree_pages(content):
    """Offsets of the meta, branch and leaf pages."""
    pages = range(0, len(content), 4096)
    headers = [(page, *struct.unpack_from("<QHH", content, page)) for page in pages]
    return [
        page for page, number, _, kind in headers if number == page // 4096 and kind in (1, 2, 8)
    ]


def test_damaged_pages_are_read_or_refused(tmp_path):
    """3,000 damaged trees: only the documented error, nothing outside the file."""
    content = published(tmp_path / "db").read_bytes()
    pages = tree_pages(content)
    assert len(pages) > 6
    chance = random.Random(0)
    refused = 0
    for number in range(3000):
        damaged = bytearray(content)
        for _ in range(chance.choice((1, 1, 2, 5))):
            damage_page(damaged, chance.choice(pages), chance)
        refused += is_refused(tmp_path / f"{number}.mdb", bytes(damaged))
    assert refused > 1000


def damage_page(content, page, chance):
    """One number of its header, its pointers or a node."""
    pointers = struct.unpack_from("<H", content, page + 12)[0] % 4096
    at = page + 2 * chance.randrange(max(pointers // 2, 80))
    if pointers > 16 and chance.random() < 0.6:
        pointer = page + 16 + 2 * chance.randrange((pointers - 16) // 2)
        at = page + struct.unpack_from("<H", content, pointer)[0] % 4088 + 2 * chance.randrange(4)
    width = chance.choice((1, 2, 4, 8))
    number = chance.choice((0, 1, 2, 3, 255, 2**16 - 1, 2**31, 2**32 - 1, 2**64 - 1))
    number = chance.choice((number, chance.randrange(2**16))) % 256**width
    content[at : at + width] = number.to_bytes(width, "little")


def is_refused(file: Path, content: bytes) -> bool:
    file.write_bytes(content)
    try:
        values = as_we_read(file)
    except InputFileError:
        return True
    finally:
        file.unlink()
    assert sum(len(value) for _, value in values) <= len(content)
    return False
