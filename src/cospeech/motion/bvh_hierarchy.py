"""The HIERARCHY part of a BVH file: joints, offsets and channels."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cospeech.errors import InputFileError
from cospeech.motion.skeleton import Skeleton

MAX_JOINTS = 4096
MAX_DEPTH = 512
MAX_NAME = 200
MAX_OFFSET = 1e7
_CHANNEL_COUNTS = {str(count): count for count in range(7)}
_CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """The joints of a BVH file and what its number columns mean.

    Attributes:
        skeleton: Joints in file order, end sites among them; offsets in metres.
        channels: Per joint its channels in column order, e.g. ``("Xposition", ..., "Yrotation")``;
            empty for end sites.
    """

    skeleton: Skeleton
    channels: tuple[tuple[str, ...], ...]

    @property
    def channel_count(self) -> int:
        """Numbers in a frame's row."""
        return sum(len(channels) for channels in self.channels)

    def joint_of_column(self, column: int) -> str:
        """Name of the joint that a column (from 0) belongs to."""
        for name, channels in zip(self.skeleton.joints, self.channels, strict=True):
            if column < len(channels):
                return name
            column -= len(channels)
        raise IndexError("column out of range")


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    is_end: bool = False
    offset: tuple[float, ...] | None = None
    channels: tuple[str, ...] = field(default=())


class _Reader:
    """Words of the header with their line numbers, and errors that name them."""

    def __init__(self, text: str, path: Path) -> None:
        self.path = path
        self.line = 1
        """Number of the line of the next word, or of the last one."""
        self._lines = self._split(text)
        self._words: list[str] = []
        self._column = 0
        self._next_line()

    @staticmethod
    def _split(text: str) -> Iterator[tuple[int, list[str]]]:
        for number, line in enumerate(io.StringIO(text, newline="\n"), start=1):
            words = line.replace("{", " { ").replace("}", " } ").split()
            if words:
                yield number, words

    def _next_line(self) -> None:
        self.line, self._words = next(self._lines, (self.line, []))
        self._column = 0

    def error(self, problem: str, line: int | None = None) -> InputFileError:
        shown = problem if len(problem) <= MAX_NAME + 100 else f"{problem[:MAX_NAME]} ..."
        return InputFileError(self.path, shown, place=f"line {line or self.line}")

    def word(self) -> str | None:
        """The next word, None at the end."""
        if not self._words:
            return None
        word = self._words[self._column]
        self._column += 1
        if self._column == len(self._words):
            self._next_line()
        return word

    def rest_of_name(self) -> str:
        """The words up to the end of the line or a brace, joined by spaces."""
        name: list[str] = []
        line = self.line
        while self.line == line and self._column > 0:
            if self._words[self._column] in "{}":
                break
            name.append(self.word() or "")
        if sum(map(len, name)) > MAX_NAME:
            raise self.error(f"a name of more than {MAX_NAME} characters", line)
        return " ".join(name)

    def numbers(self, count: int, what: str) -> tuple[float, ...]:
        values = []
        for _ in range(count):
            line, word = self.line, self.word()
            try:
                value = float(word or "")
            except ValueError:
                raise self.error(f"{what}: {word!r} is not a number", line) from None
            if not math.isfinite(value) or abs(value) > MAX_OFFSET:
                raise self.error(f"{what}: {word} is not a usable length", line)
            values.append(value)
        return tuple(values)


def parse_hierarchy(text: str, path: Path, unit_scale: float) -> Hierarchy:
    """Joints and channels from the text before ``MOTION``.

    Keywords may be in any case, braces on any line, OFFSET and CHANNELS in either order, a joint
    may have any set of channels, and an end site may have a name.

    Args:
        text: The file's text from its first line.
        path: For messages.
        unit_scale: Metres per file unit.

    Raises:
        InputFileError: It is not a BVH hierarchy; the message names the line.
    """
    reader = _Reader(text, path)
    if (reader.word() or "").upper() != "HIERARCHY":
        raise InputFileError(
            path,
            "a BVH file starts with the word HIERARCHY; this one does not",
            place="line 1",
            hint="check that it is a text BVH file (a .gz or .fbx must be converted first)",
        )
    joints: list[_Joint] = []
    open_joints: list[int] = []
    line = reader.line
    while (word := reader.word()) is not None:
        _take(word.upper(), line, reader, joints, open_joints)
        line = reader.line
    if open_joints:
        name = joints[open_joints[-1]].name
        raise reader.error(f"the brace of joint {name} is never closed: the file is cut off")
    if not joints:
        raise reader.error("no ROOT joint")
    return _hierarchy(joints, reader, unit_scale)


def _take(
    keyword: str, line: int, reader: _Reader, joints: list[_Joint], open_joints: list[int]
) -> None:
    if keyword in ("ROOT", "JOINT"):
        if keyword == "ROOT" and joints:
            raise reader.error("a second ROOT: cospeech reads one person per file", line)
        if keyword == "JOINT" and not open_joints:
            raise reader.error("a JOINT outside the ROOT's braces", line)
        _open(
            _Joint(reader.rest_of_name(), open_joints[-1] if open_joints else -1, line),
            reader,
            joints,
            open_joints,
        )
    elif keyword in ("END", "ENDSITE"):
        if not open_joints:
            raise reader.error("an end site outside the ROOT's braces", line)
        words = reader.rest_of_name().split()
        if keyword == "END" and words and words[0].upper() == "SITE":
            words = words[1:]
        end = _Joint(" ".join(words), open_joints[-1], line, is_end=True)
        _open(end, reader, joints, open_joints)
    elif keyword == "OFFSET" and open_joints:
        joints[open_joints[-1]].offset = reader.numbers(3, "OFFSET")
    elif keyword == "CHANNELS" and open_joints:
        joints[open_joints[-1]].channels = _channels(reader)
    elif keyword == "}" and open_joints:
        open_joints.pop()
    else:
        raise reader.error(f"{keyword!r} is not expected here", line)


def _open(joint: _Joint, reader: _Reader, joints: list[_Joint], open_joints: list[int]) -> None:
    if not joint.is_end and not joint.name:
        raise reader.error("a joint without a name", joint.line)
    if reader.word() != "{":
        raise reader.error(f"expected '{{' after {joint.name or 'End Site'}", joint.line)
    if len(joints) >= MAX_JOINTS or len(open_joints) >= MAX_DEPTH:
        raise reader.error(
            f"more than {MAX_JOINTS} joints or {MAX_DEPTH} levels: not a person", joint.line
        )
    open_joints.append(len(joints))
    joints.append(joint)


def _channels(reader: _Reader) -> tuple[str, ...]:
    line, word = reader.line, reader.word() or ""
    if word not in _CHANNEL_COUNTS:
        raise reader.error(f"CHANNELS {word}: expected a count from 0 to 6", line)
    channels = []
    for _ in range(_CHANNEL_COUNTS[word]):
        name = reader.word() or ""
        match = _CHANNEL.fullmatch(name)
        if match is None:
            raise reader.error(
                f"unknown channel {name!r} (expected Xposition, Zrotation ...)", line
            )
        channels.append(match[1].upper() + match[2].lower())
    if len(set(channels)) != len(channels):
        raise reader.error(f"a channel is listed twice: {' '.join(channels)}", line)
    return tuple(channels)


def _hierarchy(joints: list[_Joint], reader: _Reader, unit_scale: float) -> Hierarchy:
    seen: set[str] = set()
    for joint in joints:
        if not joint.is_end and joint.name in seen:
            raise reader.error(f"a second joint called {joint.name!r}", joint.line)
        if not joint.is_end:
            seen.add(joint.name)
    for joint in joints:
        if joint.offset is None:
            raise reader.error(f"joint {joint.name or 'End Site'} has no OFFSET", joint.line)
        if joint.is_end:
            base = joint.name or f"{joints[joint.parent].name}_end"
            name, number = base, 2
            while name in seen:
                name, number = f"{base}{number}", number + 1
            joint.name = name
            joint.channels = ()
            seen.add(name)
    skeleton = Skeleton(
        name="bvh",
        joints=tuple(joint.name for joint in joints),
        parents=tuple(joint.parent for joint in joints),
        offsets=np.array([joint.offset for joint in joints], dtype=np.float64) * unit_scale,
        end_sites=frozenset(joint.name for joint in joints if joint.is_end),
    )
    return Hierarchy(skeleton, tuple(joint.channels for joint in joints))
