"""What a file can become: damaged as disks do it, and filled with what breaks careless code."""

import io
import random
import re
import warnings
import zipfile
from collections.abc import Sequence

from tests.fabricated import damage

TOKENS = (
    *(b"0", b"-1", b"1e308", b"1e999", b"-0.0", b"nan", b"inf", b"Infinity", b"NaN", b"1e-320"),
    *(b"4294967296", b"9223372036854775808", b"99999999999999999999", b"1" * 400, b"9" * 5000),
    *(b"[" * 2000, b"{" * 100, b"(" * 500, b'{"a":' * 1000, b"]", b"}", b'"', b"'", b"\\"),
    *(b"\0", b"\0" * 64, b"\r", b"\n" * 200, b"\t", b" " * 3000, b",", b",,,,", b";", b":", b"|"),
    *(b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xc3\x28", b"\x80", b"\\ud800", b"\\u0000"),
    *(b"null", b"true", b"[]", b"{}", b'""', b"[[]]", b'{"": []}', b"1.5", b'"text"', b"[1e400]"),
    *(b"*a", b"&a [*a,*a]", b"!!python/object:os.system", b"2024-13-45", b"<<: {}", b"- - - -"),
    *(b"&lol;", b"<!ENTITY a 'b'>", b"<a>" * 300, b"]]>", b"${oc.env:HOME}", b"../../../etc"),
    *(b"(a|b|)*" * 20, b"(?=x)", b"a" * 70000, b"0x10", b"1_000", b"\xd9\xa3", "İ".encode()),
)
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?")
_VALUE = re.compile(rb'"[^"\n]{0,200}"|-?\d[\d.eE+-]*|true|false|null')


def mutated(original: bytes, others: Sequence[bytes], chance: random.Random) -> bytes:
    """One mutation of a file.

    Args:
        original: Its bytes.
        others: Bytes of files that it may be spliced with.
        chance: Decides everything.
    """
    if original.startswith(b"PK\x03\x04") and chance.random() < 0.8:
        return _inside_zip(original, others, chance)
    return _changed(original, others, chance)


def _changed(original: bytes, others: Sequence[bytes], chance: random.Random) -> bytes:
    data = bytearray(original)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        if not data:
            break
        at = chance.randrange(len(data))
        way = chance.choice((*damage.WAYS, _insert, _insert, _number, _value, _twice))
        way(data, at, chance, [other for other in others if other] or [b"\0"])
    return bytes(data)


def _insert(data: bytearray, at: int, chance: random.Random, others: Sequence[bytes]) -> None:
    data[at:at] = chance.choice(TOKENS)


def _number(data: bytearray, at: int, chance: random.Random, others: Sequence[bytes]) -> None:
    _replace(_NUMBER, data, at, chance)


def _value(data: bytearray, at: int, chance: random.Random, others: Sequence[bytes]) -> None:
    _replace(_VALUE, data, at, chance)


def _replace(pattern: re.Pattern[bytes], data: bytearray, at: int, chance: random.Random) -> None:
    if found := pattern.search(data, at):
        data[found.start() : found.end()] = chance.choice(TOKENS)


def _twice(data: bytearray, at: int, chance: random.Random, others: Sequence[bytes]) -> None:
    stop = at + chance.randrange(1, 2000)
    data[at:at] = bytes(data[at:stop]) * chance.choice((1, 1, 2, 50))


def _inside_zip(original: bytes, others: Sequence[bytes], chance: random.Random) -> bytes:
    """Change a part of a zip file; its directory and checksums are right again afterwards."""
    with zipfile.ZipFile(io.BytesIO(original)) as archive:
        parts = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    # What is said of the numbers is more interesting than the numbers are.
    small = [name for name in parts if len(parts[name]) < 20_000]
    name = chance.choice(small if small and chance.random() < 0.9 else list(parts))
    pickles = [part for part in parts if part.endswith("data.pkl")]
    if pickles and chance.random() < 0.6:
        name = pickles[0]
    parts[name] = _changed(parts[name], [*parts.values(), *others], chance)
    how = chance.choice((zipfile.ZIP_STORED,) * 5 + (zipfile.ZIP_DEFLATED,))
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", how) as archive:
        warnings.simplefilter("ignore")  # of equal names, which are meant
        for part, content in parts.items():
            chosen = chance.choice(list(parts)) if chance.random() < 0.01 else part
            archive.writestr(zipfile.ZipInfo(chosen), content, how)
    return buffer.getvalue()
