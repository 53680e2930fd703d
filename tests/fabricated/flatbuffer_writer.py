"""Write flatbuffers from dicts, lists and numbers."""

import struct


class Numbers:
    """A vector of numbers, or of structs of numbers in a row."""

    def __init__(self, code, numbers):
        self.code, self.numbers = code, tuple(numbers)


class Inline(Numbers):
    """A struct inside its table."""


def flatbuffer(fields) -> bytes:
    """A root table given as {field index: value}.

    A value is a table (dict), a vector of tables (list), a string, `Numbers`, `Inline`, or a number
    as (struct code, value), which is left out where it is 0, every default used here. A table that
    occurs twice in a vector is written once.
    """
    out = bytearray(4)
    struct.pack_into("<I", out, 0, write_table(out, fields))
    return bytes(out)


def write_table(out, fields) -> int:
    fields = {i: value for i, value in fields.items() if not absent(value)}
    slots, size = {}, 4
    for index, value in fields.items():
        width = struct.calcsize("<" + code_of(value))
        # a struct is aligned like its first number
        unit = struct.calcsize("<" + code_of(value)[0])
        size += -size % unit
        slots[index] = size
        size += width
    count = max(fields, default=-1) + 1
    pad(out, 8)
    vtable = len(out)
    out += struct.pack("<HH", 4 + 2 * count, size)
    out += struct.pack(f"<{count}H", *(slots.get(index, 0) for index in range(count)))
    pad(out, 8)
    table = len(out)
    out += bytes(size)
    struct.pack_into("<i", out, table, table - vtable)
    for index, value in fields.items():
        at = table + slots[index]
        if isinstance(value, Inline):
            struct.pack_into("<" + value.code, out, at, *value.numbers)
        elif isinstance(value, tuple):
            struct.pack_into("<" + value[0], out, at, value[1])
        else:
            struct.pack_into("<I", out, at, write_child(out, value) - at)
    return table


def write_child(out, value) -> int:
    if isinstance(value, dict):
        return write_table(out, value)
    # the items of a vector are aligned to 8, its count lies before them
    pad(out, 8)
    out += bytes(4)
    start = len(out)
    if isinstance(value, str):
        out += struct.pack("<I", len(value)) + value.encode() + b"\0"
    elif isinstance(value, Numbers):
        out += struct.pack("<I", len(value.numbers) // len(value.code))
        out += struct.pack("<" + value.code[0] * len(value.numbers), *value.numbers)
    else:
        out += struct.pack("<I", len(value)) + bytes(4 * len(value))
        written = {}
        for index, item in enumerate(value):
            at = start + 4 + 4 * index
            if id(item) not in written:
                written[id(item)] = write_table(out, item)
            struct.pack_into("<I", out, at, written[id(item)] - at)
    return start


def absent(value) -> bool:
    return isinstance(value, tuple) and not value[1]


def code_of(value) -> str:
    if isinstance(value, Inline):
        return value.code
    return value[0] if isinstance(value, tuple) else "I"


def pad(out, alignment):
    out += bytes(-len(out) % alignment)
