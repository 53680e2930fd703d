"""Damage bytes as downloads, disks and attackers do."""

import random
from collections.abc import Iterator, Sequence

INTERESTING = (
    *(0, 1, 2, 3, 4, 5, 7, 8, 14, 16, 63, 64, 127, 128, 255, 256, 0x7FFF, 0x8000, 0xFFFF),
    *(2**31 - 1, 2**31, 2**32 - 8, 2**32 - 1, 2**40, 2**60, 2**62, 2**63 - 1, 2**63, 2**64 - 1),
)


def damaged(originals: Sequence[bytes], count: int, seed: int) -> Iterator[bytes]:
    """So many mutations: flipped bits, cut ends, parts of other values, repeated and missing
    parts, and numbers that break careless code at places where numbers are."""
    chance = random.Random(seed)
    for _ in range(count):
        data = bytearray(chance.choice(originals))
        for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
            if data:
                chance.choice(WAYS)(data, chance.randrange(len(data)), chance, originals)
        yield bytes(data)


def flip(data, at, chance, originals):
    data[at] ^= 1 << chance.randrange(8)


def set_byte(data, at, chance, originals):
    data[at] = chance.randrange(256)


def set_number(data, at, chance, originals):
    width = chance.choice((1, 2, 4, 8))
    number = chance.choice(INTERESTING) % 256**width
    at -= at % width
    data[at : at + width] = number.to_bytes(width, "little")


def cut(data, at, chance, originals):
    del data[at:]


def splice(data, at, chance, originals):
    other = chance.choice(originals)
    start, length = chance.randrange(len(other)), chance.randrange(1, 200)
    data[at : at + length] = other[start : start + length]


def repeat(data, at, chance, originals):
    start = chance.randrange(len(data))
    data[at:at] = data[start : start + chance.choice((1, 4, 8, 64))]


def drop(data, at, chance, originals):
    del data[at : at + chance.choice((1, 4, 8, 64))]


WAYS = (flip, set_byte, set_number, set_number, cut, splice, repeat, drop)
