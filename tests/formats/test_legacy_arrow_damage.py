"""Damaged and hostile values: each is read or refused, in time and memory bound by its size."""

import pickle
import struct
import time
import tracemalloc
from itertools import product

import numpy as np
import pytest

from cospeech.errors import CospeechError
from cospeech.formats.legacy_arrow import LegacyArrowError, loads
from cospeech.formats.legacy_arrow.tensors import parse_tensor
from tests.fabricated import legacy_arrow_writer as writer
from tests.fabricated.damage import damaged
from tests.fabricated.flatbuffer_writer import Numbers, flatbuffer, pad
from tests.fabricated.legacy_arrow_values import AS_WRITTEN, marked
from tests.fabricated.legacy_arrow_writer import write_legacy_arrow


def small_values(shared_or_none):
    """Our own values, and the fixture's where it is there."""
    own = [write_legacy_arrow(value) for value in AS_WRITTEN.values()]
    own += [marked("int", str(2**70)), marked("collections.deque", [1, 2])]
    own += [marked("np.array", (np.zeros(3, "u1"), "|b1"))]
    if shared_or_none is not None:
        folder = shared_or_none / "data" / "ted_legacy_fixture"
        found = [path.read_bytes() for path in sorted(folder.glob("*/**/*.bin"))]
        own += [value for value in found if len(value) < 8000]
    return own


def check_damaged(originals, count, seed):
    """Every value is read or refused at a place in it; returns how many are refused, and the
    longest time that one took."""
    refused, longest = 0, 0.0
    for value in damaged(originals, count, seed):
        start = time.process_time()
        offset = refusal(value)
        longest = max(longest, time.process_time() - start)
        if offset is not None:
            refused += 1
            assert 0 <= offset <= len(value)
    return refused, longest


def refusal(value):
    try:
        loads(value)
    except LegacyArrowError as error:
        return error.offset
    return None


@pytest.mark.parametrize("genuine", [False, True], ids=["own", "genuine"])
def test_twenty_thousand_damaged_values_are_read_or_refused(genuine, request):
    originals = small_values(request.getfixturevalue("shared") if genuine else None)
    tracemalloc.start()
    try:
        check_damaged(originals, 500, seed=1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 16 * 2**20
    refused, longest = check_damaged(originals, 20_000, seed=2)
    assert refused > 10_000
    assert longest < 5.0


def patched(value, **words):
    """A value with some of its header's counts replaced."""
    counts = list(struct.unpack_from("<4i", value))
    for name, number in words.items():
        counts[("tensors", "arrays", "buffers", "padding").index(name)] = number
    return struct.pack("<4i", *counts) + value[16:]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"arrays": 2**31 - 1}, "ends where a message should begin"),
        ({"arrays": 0}, "array 0 doesn't exist"),
        ({"arrays": -1}, "counts"),
        ({"buffers": 2**31 - 1}, "ends where a buffer should begin"),
        ({"padding": 7}, "0.11 or older"),
    ],
)
def test_wrong_counts(words, reason):
    with pytest.raises(LegacyArrowError, match=reason):
        loads(patched(write_legacy_arrow([np.zeros(3)]), **words))


class Hostile(writer.Sequence):
    """A sequence that can lie about what it writes."""

    def value(self):
        """The bytes of a value with this sequence instead of its list of one element."""
        batch = writer.Batch()
        self.write(batch)
        return assembled(self.field("list"), batch, self.arrays)


def assembled(root, batch, stored=()):
    """The bytes of a value of any schema and batch."""
    out = bytearray(struct.pack("<4i", 0, len(stored), 0, 0))
    out += writer.message({0: ("h", 3), 1: ("B", 1), 2: {1: [root]}}, 8)
    content = {0: ("q", 1), 1: Numbers("qq", batch.nodes)}
    content[2] = Numbers("qq", batch.buffers)
    fields = {0: ("h", 3), 1: ("B", 3), 2: content, 3: ("q", len(batch.body))}
    out += writer.message(fields, 8) + batch.body + bytes(4)
    pad(out, 64)
    for array in stored:
        out += writer.tensor(array)
        pad(out, 64)
    return bytes(out)


def of(items):
    """A sequence whose single element is this one."""
    sequence = Hostile([])
    sequence.append(items)
    return sequence


def refuse(value, reason, most_bytes=2**24):
    """Check that a value is refused for a reason, at once and without much memory."""
    tracemalloc.start()
    start = time.process_time()
    try:
        with pytest.raises(LegacyArrowError, match=reason):
            loads(value)
        assert tracemalloc.get_traced_memory()[1] < most_bytes
    finally:
        tracemalloc.stop()
    assert time.process_time() - start < 10


def test_overlapping_rows_are_refused():
    """10,000 lists of the same 10,000 items would be 10^8 items from 80 kB."""
    sequence = of([[0] * 10_000])
    lists = sequence.columns[writer.LIST].parts[0].columns[writer.LIST]
    lists.edges = [0, 10_000] * 5_000
    inner = sequence.columns[writer.LIST].parts[0]
    inner.types, inner.offsets = [0] * 9_999, list(range(9_999))
    inner.present = [True] * 9_999
    sequence.columns[writer.LIST].edges = [0, 9_999]
    refuse(sequence.value(), "offsets don't start at 0 or go back")


def test_rows_used_twice_are_refused():
    for count in (3, 100):
        sequence = of([[1, 2]] * count)
        sequence.columns[writer.LIST].parts[0].offsets = [0] * count
        refuse(sequence.value(), "once and in order")


def test_arrays_used_twice_are_refused():
    sequence = of([np.zeros(1000), np.zeros(1000)])
    sequence.columns[writer.LIST].parts[0].columns[writer.ARRAY][1] = 0
    refuse(sequence.value(), "array 0 doesn't exist or is used twice")


def test_buffers_that_overlap_are_refused():
    batch = writer.Batch()
    sequence = of(["text", 1.0])
    sequence.write(batch)
    batch.buffers[2:] = [0, len(batch.body)] * (len(batch.buffers) // 2 - 1)
    refuse(assembled(sequence.field("list"), batch), "buffers overlap")


def test_lengths_beyond_the_buffers_are_refused():
    for rows in (2**31 - 1, 2**60, -1):
        batch = writer.Batch()
        sequence = of([1, 2, 3])
        sequence.write(batch)
        batch.nodes[4] = rows  # the items of the list
        refuse(assembled(sequence.field("list"), batch), "rows instead of")


def test_column_of_nothing_with_2_to_60_rows_is_refused():
    """From 1.0 on None is a column without buffers, whose length only its union limits."""
    item = writer.field("item", writer.UNION_TYPE, UNION_OF_ONE, [null_field()])
    lists = writer.field("10", writer.LIST_TYPE, {}, [item])
    root = writer.field("list", writer.UNION_TYPE, UNION_OF_ONE, [lists])
    for rows in (3, 2**60):
        batch = writer.Batch()
        batch.add(b"\0", bytes(4), rows=1)
        batch.add(b"", struct.pack("<2i", 0, 3), rows=1)
        batch.add(bytes(3), struct.pack("<3i", 0, 1, 2), rows=3)
        batch.add(rows=rows, nulls=rows)
        value = modern(root, batch)
        if rows == 3:
            assert loads(value) == [None] * 3
        else:
            refuse(value, "rows instead of 3")


UNION_OF_ONE = {0: ("h", 1), 1: Numbers("i", [0])}


def null_field():
    return writer.field("0", writer.NULL_TYPE, {}, [])


def modern(root, batch):
    """A value without arrays as pyarrow 1.0 and later framed it."""
    out = bytearray(16)
    content = {0: ("q", 1), 1: Numbers("qq", batch.nodes)}
    content[2] = Numbers("qq", batch.buffers)
    for fields, body in (
        ({1: ("B", 1), 2: {1: [root]}}, b""),
        ({1: ("B", 3), 2: content, 3: ("q", len(batch.body))}, batch.body),
    ):
        metadata = flatbuffer({0: ("h", 4)} | fields)
        metadata += bytes(-len(metadata) % 8)
        out += struct.pack("<ii", -1, len(metadata)) + metadata + body
    out += struct.pack("<ii", -1, 0)
    pad(out, 64)
    return bytes(out)


def test_deep_nesting_is_refused():
    def nested(levels):
        value = "leaf"
        for _ in range(levels):
            value = [value]
        return value

    assert loads(write_legacy_arrow(nested(25))) == nested(25)
    refuse(write_legacy_arrow(nested(60)), "nested deeper than 100 levels")


def test_fields_used_more_than_once_are_refused():
    """Twenty dicts, each with one field as both keys and values, would be a million columns."""
    union = writer.field("", writer.UNION_TYPE, {0: ("h", 1), 1: Numbers("i", [])}, [])
    for _ in range(20):
        item = writer.field("item", writer.STRUCT_TYPE, {}, [union, union])
        dicts = writer.field("10", writer.LIST_TYPE, {}, [item])
        union = writer.field("list", writer.UNION_TYPE, UNION_OF_ONE, [dicts])
    refuse(assembled(union, writer.Batch()), "fields of the schema are used more than once")


@pytest.mark.parametrize(
    ("shape", "strides", "size_bytes", "reason"),
    [
        ((2**31, 2**33), (2**36, 8), 48, "impossible"),
        ((2**32, 2**32), (2**35, 8), 0, "impossible"),
        ((-2, -3), (24, 8), 48, "impossible"),
        ((0, 2**62), (8, 8), 0, "impossible"),
        ((2**20, 2**20), (2**23, 8), 48, "doesn't fit a body of 48 bytes"),
        ((2, 3), (24, 8), -48, "doesn't fit"),
        ((2, 3), (24, 0), 48, "strides"),
        ((2, 3), (2**40, 8), 48, "strides"),
        ((2, 3), (8,), 48, "strides"),
        ((1,) * 40, (8,) * 40, 8, "too many dimensions"),
    ],
)
def test_impossible_tensors_are_refused(shape, strides, size_bytes, reason):
    fields = writer.tensor_fields("f8", shape, strides, size_bytes)
    with pytest.raises(LegacyArrowError, match=reason):
        parse_tensor(flatbuffer(fields))


def test_tensor_layouts_of_the_writer_are_read():
    for shape, strides in [((2, 3), (24, 8)), ((2, 3), (8, 16)), ((1, 3), (99, 8)), ((), ())]:
        layout = parse_tensor(flatbuffer(writer.tensor_fields("f8", shape, strides)))
        assert (layout.dtype, layout.shape, layout.strides) == (np.float64, shape, strides)
    empty = writer.tensor_fields("f2", (0, 10, 3), (2, 2, 2))
    assert parse_tensor(flatbuffer(empty)).shape == (0, 10, 3)


def test_keys_chosen_to_collide_are_refused():
    """-1 and -2 have one hash, so 2^14 tuples of them have one hash, too."""
    keys = list(product((-1, -2), repeat=14))
    assert len(set(map(hash, keys))) == 1
    refuse(write_with_keys(keys, writer.DICT), "collide", most_bytes=2**26)
    refuse(write_with_keys(keys, writer.SET), "collide", most_bytes=2**26)
    honest = [(x, y) for x in range(100) for y in range(100)]
    assert len(loads(write_legacy_arrow(dict.fromkeys(honest, 0)))) == 10_000


class Pairs(list):
    """Items of a dict or set whose making would take too long here as well."""

    def items(self):
        return self


def write_with_keys(keys, tag):
    sequence = Hostile([])
    container = sequence.columns[tag] = writer.Container(tag, [])
    container.append(Pairs([(key, 0) for key in keys] if tag == writer.DICT else keys))
    sequence.present, sequence.types, sequence.offsets = [True], [0], [0]
    return sequence.value()


def test_equal_keys_are_refused():
    for tag in (writer.DICT, writer.SET):
        with pytest.raises(LegacyArrowError, match="equal"):
            loads(write_with_keys(["a", "a"], tag))


def test_text_that_is_not_utf8_is_refused_with_its_offset():
    value = write_legacy_arrow(["grün"])
    place = value.index("grün".encode())
    with pytest.raises(LegacyArrowError, match="text isn't UTF-8") as raised:
        loads(value.replace("ü".encode(), b"\xff\xff"))
    assert raised.value.offset == place
    assert isinstance(raised.value, CospeechError)


def test_the_error_crosses_processes():
    error = pickle.loads(pickle.dumps(LegacyArrowError("broken", 7, "mend it")))
    assert (str(error), error.offset) == ("byte 7: broken\n  -> mend it", 7)


def test_what_is_no_value_at_all_is_refused():
    for value in (b"", b"\0" * 24, b"\0" * 1000, b"\xff" * 1000, b"PK\x03\x04" * 100):
        with pytest.raises(LegacyArrowError):
            loads(value)
