"""The reader of pyarrow.serialize values, on genuine bytes and on our own."""

import hashlib
import json
import struct
from collections import Counter, OrderedDict, defaultdict, deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from cospeech.formats.legacy_arrow import LegacyArrowError, loads
from cospeech.formats.legacy_arrow.flatbuffer import INT64, Table
from cospeech.formats.lmdb_file import find_values
from tests.fabricated.legacy_arrow_values import AS_WRITTEN, NUMBERS, marked
from tests.fabricated.legacy_arrow_writer import write_legacy_arrow
from tests.ted_fixture import describe, expected

PICKLED = "custom_defaultdict_has_pickle"
NOT_READ = ("pyarrow-0.11.1", "pyarrow-0.12.1")
DATABASES = {"lmdb_train": 3, "lmdb_val": 1, "lmdb_val_cache": 26, "lmdb_expressive": 2}


@pytest.fixture(scope="module")
def fixture(shared):
    return shared / "data" / "ted_legacy_fixture"


def cases(folder):
    """Name, bytes and description of each value of a folder of the fixture."""
    for name, case in json.loads((folder / "expected.json").read_text())["cases"].items():
        yield name, (folder / f"{name}.bin").read_bytes(), expected(case["decoded"])


# genuine bytes ----------------------------------------------------------------------------------


def test_edge_cases_equal_their_sidecar(fixture):
    read = 0
    for name, value, wanted in cases(fixture / "edge_cases"):
        if name != PICKLED:
            assert describe(loads(value)) == wanted, name
            read += 1
    assert read == 40


def test_pickled_value_is_refused(fixture):
    value = (fixture / "edge_cases" / f"{PICKLED}.bin").read_bytes()
    with pytest.raises(LegacyArrowError, match="'type' is pickled, which is never read"):
        loads(value)


@pytest.mark.parametrize("database", DATABASES)
def test_databases_equal_their_sidecar(fixture, database):
    entries = json.loads((fixture / f"expected_{database}.json").read_text())["entries"]
    values = find_values(fixture / database)
    assert [key.decode() for key in values.places] == [entry["key"] for entry in entries]
    assert len(entries) == DATABASES[database]
    for entry in entries:
        value = values.read(entry["key"].encode())
        assert hashlib.sha256(value).hexdigest() == entry["value_sha256"]
        assert describe(loads(value), inline=0) == entry["value"], entry["key"]


def test_versions_are_read_or_refused_with_the_reason(fixture):
    folders = sorted((fixture / "version_matrix").iterdir())
    assert len(folders) == 7
    for folder in folders:
        for name, value, wanted in cases(folder):
            if folder.name in NOT_READ:
                reason = "pyarrow 0.11 or older" if "0.11" in folder.name else "pyarrow 0.12"
                with pytest.raises(LegacyArrowError, match=reason):
                    loads(value)
            else:
                assert describe(loads(value)) == wanted, (folder.name, name)


@pytest.mark.parametrize("step", [512, 500])
def test_cut_sample_is_refused_at_any_length(fixture, step):
    value = find_values(fixture / "lmdb_val_cache").read(b"0000000003")
    for length in range(0, len(value), step):
        with pytest.raises(LegacyArrowError) as raised:
            loads(value[:length])
        assert 0 <= raised.value.offset <= length


# the test writer against genuine bytes ----------------------------------------------------------


def parts(value):
    """Everything but the metadata: counts, the batch's nodes, buffers and body, arrays' bodies."""
    found = [value[:16]]
    at = 16
    for number in range(2 + struct.unpack_from("<i", value, 4)[0]):
        length = struct.unpack_from("<i", value, at)[0]
        message = Table.root(value[at + 4 : at + 4 + length])
        at += 4 + length
        stop = at + message.number(3, INT64)
        if number == 1:
            found += [message.table(2).numbers(1, "q", 2), message.table(2).numbers(2, "q", 2)]
        found.append((at % 8 == 0, value[at:stop]))
        at = stop
        if number:
            at = -(-(at + 4 * (number == 1)) // 64) * 64
    return found, at == len(value)


@pytest.mark.parametrize("name", AS_WRITTEN)
def test_fabricated_bodies_equal_genuine_ones(fixture, name):
    genuine = (fixture / "edge_cases" / f"{name}.bin").read_bytes()
    ours = write_legacy_arrow(AS_WRITTEN[name])
    assert parts(ours) == parts(genuine)
    assert describe(loads(ours)) == describe(loads(genuine))


# round trips ------------------------------------------------------------------------------------

NUMERIC = st.sampled_from([np.dtype("<" + code) for code in NUMBERS])
SHAPES = arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5)
LEAVES = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text()
    | st.binary()
    | st.datetimes()
)
KEYS = st.recursive(LEAVES, lambda inner: st.tuples(inner, inner), max_leaves=3)
VALUES = st.recursive(
    LEAVES | arrays.arrays(NUMERIC, SHAPES),
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.dictionaries(KEYS, inner)
        | st.sets(KEYS)
        | st.lists(st.lists(st.integers(0, 5) | st.floats(0, 1)), max_size=40)
    ),
    max_leaves=30,
)


@given(VALUES)
@settings(max_examples=200, deadline=None)
def test_what_is_written_is_read(value):
    assert describe(loads(write_legacy_arrow(value))) == describe(value)


@given(st.lists(st.none() | st.integers(0, 9) | st.floats(0, 1) | st.text(max_size=2)))
@settings(max_examples=100, deadline=None)
def test_long_mixed_sequences_are_read(items):
    """More rows than are counted one by one."""
    long = items * 20
    assert describe(loads(write_legacy_arrow(long))) == describe(long)


def test_arrays_are_copies():
    array = np.asfortranarray(np.arange(6, dtype="f2").reshape(2, 3))
    read = loads(write_legacy_arrow([array, array]))
    for copy in read:
        np.testing.assert_array_equal(copy, array)
        assert copy.flags.owndata
        assert copy.flags.writeable
        assert copy.flags.c_contiguous
    read[0][:] = 0
    np.testing.assert_array_equal(read[1], array)


# custom types -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "data", "wanted"),
    [
        ("int", str(-(2**90)), -(2**90)),
        ("collections.OrderedDict", (["b", "a"], [1, 2]), OrderedDict(b=1, a=2)),
        ("collections.Counter", (["a"], [3]), Counter("aaa")),
        ("collections.defaultdict", (["a"], [3], None), defaultdict(None, a=3)),
        ("collections.deque", [1, "x"], deque([1, "x"])),
    ],
)
def test_whitelisted_custom_types(name, data, wanted):
    read = loads(marked(name, data))
    assert type(read) is type(wanted)
    assert read == wanted


@pytest.mark.parametrize(
    "original",
    [np.array([[True, False]]), np.array(["ab", ""]), np.array([1 + 2j]), np.array([b"a", b"bc"])],
    ids=["bool", "text", "complex", "bytes"],
)
def test_arrays_of_unusual_types(original):
    read = loads(marked("np.array", (original.view("u1"), original.dtype.str)))
    assert read.dtype == original.dtype
    np.testing.assert_array_equal(read, original)


@pytest.mark.parametrize(
    ("name", "data", "more", "reason"),
    [
        ("type", b"cbuiltins\nint\n.", {"pickle": True}, "'type' is pickled"),
        ("int", "1", {"pickle": False}, "'int' is pickled"),
        ("pd.DataFrame", {}, {}, "'pd.DataFrame' aren't read"),
        ("torch.Tensor", np.zeros(2), {}, "'torch.Tensor' aren't read"),
        ("int", "0x10", {}, "decimal digits"),
        ("int", "9" * 5000, {}, "decimal digits"),
        ("int", "1", {"x": 1}, "other parts"),
        (5, "1", {}, "isn't a short text"),
        ("np.array", (np.zeros(4, "u1"), "(9999,)i4"), {}, "unusual type"),
        ("np.array", (np.zeros(4, "u1"), "<i3"), {}, "can't be seen as <i3"),
        ("np.array", (np.zeros(4, "u1"), "<i8"), {}, "byte"),
        ("np.array", ([[np.zeros(9)]], "|O"), {}, "unusual type"),
        ("collections.Counter", (["a", "b"], [3]), {}, "keys and values"),
        ("collections.defaultdict", (["a"], [3], "int"), {}, "keys and values"),
        ("collections.OrderedDict", ([[]], [3]), {}, "unhashable"),
    ],
)
def test_other_custom_types_are_refused(name, data, more, reason):
    with pytest.raises(LegacyArrowError, match=reason):
        loads(marked(name, data, **more))
