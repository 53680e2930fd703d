"""The espeak-ng engine behind ctypes, and the worker process that serves it.

The engine keeps state between calls (pitch flutter, noise), so the same call gives other samples
the second time. Only a fresh process that makes the same calls in the same order repeats itself bit
for bit.
`cospeech.speech.tts` therefore starts ``python -m cospeech.speech.espeak`` once per corpus; nothing
else should create an `Engine`.

The worker reads one JSON list of requests from stdin and answers each on stdout with a 4-byte
little-endian length, that many bytes of JSON, and the samples as little-endian int16.
"""

from __future__ import annotations

import ctypes
import difflib
import json
import os
import struct
import sys
import tempfile
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

ENGINE_RATE = 22_050
"""Samples per second of the engine's voices."""

LONGEST_DATA_PATH = 150
"""Characters. A little above this the engine drops the path without a word and looks elsewhere."""

_SYNCHRONOUS = 2
_PHONEMES_AS_IPA_AND_NO_EXIT = 1 | 2 | 0x8000
_UTF8 = 1
_RATE, _VOLUME, _PITCH, _PITCH_RANGE = 1, 2, 3, 4
_END, _WORD, _CLAUSE_END, _PHONEME = 0, 1, 5, 7


class EngineError(Exception):
    """The engine or its data can't do what was asked; the message is for the user."""


class _Identity(ctypes.Union):
    _fields_ = (
        ("number", ctypes.c_int),
        ("name", ctypes.c_char_p),
        ("string", ctypes.c_char * 8),
    )


class _Event(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _Identity),
    )


_SynthCallback = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


@contextmanager
def short_data_path(data_path: Path) -> Iterator[Path]:
    """A path to the engine's data that is short enough for its fixed buffer.

    Args:
        data_path: Folder ``espeak-ng-data``, perhaps deep inside a virtual environment.

    Yields:
        The folder itself, or a link to it in a temporary folder.

    Raises:
        EngineError: The temporary folder's own path is too long as well.
    """
    if len(os.fsencode(data_path)) <= LONGEST_DATA_PATH:
        yield data_path
        return
    with tempfile.TemporaryDirectory(prefix="espeak-") as folder:
        link = Path(folder) / "espeak-ng-data"
        if len(os.fsencode(link)) > LONGEST_DATA_PATH:
            raise EngineError(
                f"espeak-ng can't open data under a path this long: {data_path}; "
                "set TMPDIR to a short folder"
            )
        link.symlink_to(data_path, target_is_directory=True)
        yield link


class Engine:
    """One espeak-ng instance. Not thread-safe, one per process.

    Args:
        library: Shared library.
        data_path: Its data folder, short enough (see `short_data_path`).

    Raises:
        EngineError: The library can't be initialised with this data.
    """

    def __init__(self, library: str | Path, data_path: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.espeak_Synth.argtypes = (
            ctypes.c_char_p,
            ctypes.c_size_t,
            ctypes.c_uint,
            ctypes.c_int,
            ctypes.c_uint,
            ctypes.c_uint,
            ctypes.c_void_p,
            ctypes.c_void_p,
        )
        rate = self._library.espeak_Initialize(
            _SYNCHRONOUS, 0, os.fsencode(data_path), _PHONEMES_AS_IPA_AND_NO_EXIT
        )
        if rate != ENGINE_RATE:
            raise EngineError(f"espeak-ng could not start with data at {data_path} (rate {rate})")
        # initialising seeds the noise of breathy voices from the clock
        self._library.espeak_ng_SetRandSeed(ctypes.c_long(1))
        self._variants = {path.name for path in (data_path / "voices" / "!v").iterdir()}
        self._samples: list[bytes] = []
        self._events: list[tuple[int, int, int, str]] = []
        # the library holds only the address: without this reference it would call freed memory
        self._callback = _SynthCallback(self._collect)
        self._library.espeak_SetSynthCallback(self._callback)

    def _collect(self, samples: Any, count: int, events: Any) -> int:
        if count > 0:
            self._samples.append(ctypes.string_at(samples, 2 * count))
        i = 0
        while events[i].type != _END:
            event = events[i]
            if event.type in (_WORD, _CLAUSE_END, _PHONEME):
                symbol = ""
                if event.type == _PHONEME:
                    # eight bytes, with no closing NUL when the symbol fills them
                    address = ctypes.addressof(event) + _Event.id.offset
                    symbol = ctypes.string_at(address, 8).split(b"\0")[0].decode("utf-8", "ignore")
                self._events.append((event.type, event.text_position, event.sample, symbol))
            i += 1
        return 0

    def set_voice(self, name: str) -> None:
        """Chooses ``language[+variant]``.

        Raises:
            EngineError: The build has no such language or variant.
        """
        language, _, variant = name.partition("+")
        # the engine accepts an unknown variant silently and speaks with the plain voice
        if variant and variant not in self._variants:
            near = difflib.get_close_matches(variant, sorted(self._variants), n=3, cutoff=0.0)
            raise EngineError(f"unknown voice variant {variant!r}; the nearest are {near}")
        if self._library.espeak_SetVoiceByName(name.encode()) != 0:
            raise EngineError(f"unknown voice {language!r}; try 'en-us', 'en' or 'en-gb-scotland'")

    def speak(self, request: dict[str, Any]) -> tuple[list[tuple[int, int, int, str]], bytes]:
        """Speaks one text, with one word event for every whitespace-separated token.

        Args:
            request: ``text``, ``voice``, ``rate``, ``volume``, ``pitch``, ``pitch_range``.

        Returns:
            Events ``(type, token index, sample, symbol)`` and the int16 samples.

        Raises:
            EngineError: Unknown voice, or the engine refuses the text or splits one of its tokens.
        """
        self.set_voice(request["voice"])
        for parameter, key in (
            (_RATE, "rate"),
            (_VOLUME, "volume"),
            (_PITCH, "pitch"),
            (_PITCH_RANGE, "pitch_range"),
        ):
            self._library.espeak_SetParameter(parameter, request[key], 0)
        tokens = request["text"].split()
        apart: set[int] = set()
        # the dictionary runs frequent pairs ("of the", "out of") together into one word event; a
        # bar between the two, which has no sound, keeps them apart
        while True:
            events = self._synthesise(tokens, apart)
            heard = [token for kind, token, _, _ in events if kind == _WORD]
            missing = set(range(len(tokens))) - set(heard)
            if not missing:
                break
            if missing <= apart:
                lost = " ".join(tokens[token] for token in sorted(missing))
                raise EngineError(f"espeak-ng has no sound for {lost!r} in {request['text']!r}")
            apart |= missing
        if len(heard) != len(tokens):
            split = next(tokens[token] for token in heard if heard.count(token) > 1)
            raise EngineError(f"espeak-ng speaks {split!r} as several words; write it out as words")
        return events, b"".join(self._samples)

    def _synthesise(self, tokens: list[str], apart: set[int]) -> list[tuple[int, int, int, str]]:
        pieces, starts, length = [], [], 0
        for index, token in enumerate(tokens):
            separator = "" if index == 0 else " | " if index in apart else " "
            starts.append(length + len(separator))
            pieces.append(separator + token)
            length += len(separator) + len(token)
        spoken = "".join(pieces)
        self._samples, self._events = [], []
        text = spoken.encode()
        status = self._library.espeak_Synth(text, len(text) + 1, 0, 1, 0, _UTF8, None, None)
        if status != 0:
            raise EngineError(f"espeak-ng refused {spoken!r} (status {status})")
        self._library.espeak_Synchronize()
        return [
            (kind, max(bisect_right(starts, position - 1) - 1, 0), sample, symbol)
            for kind, position, sample, symbol in self._events
        ]


def serve(requests: list[dict[str, Any]], out: BinaryIO) -> None:
    """Answers the requests in order; an `EngineError` is answered as ``{"error": ...}``."""
    try:
        import espeakng_loader
    except ImportError:
        _answer(out, {"missing": "espeakng-loader"}, b"")
        return
    try:
        with short_data_path(Path(espeakng_loader.get_data_path())) as data_path:
            engine = Engine(espeakng_loader.get_library_path(), data_path)
            for request in requests:
                events, samples = engine.speak(request)
                _answer(out, {"events": events, "bytes": len(samples)}, samples)
    except EngineError as error:
        _answer(out, {"error": str(error)}, b"")


def _answer(out: BinaryIO, header: dict[str, Any], samples: bytes) -> None:
    encoded = json.dumps(header).encode()
    out.write(struct.pack("<I", len(encoded)) + encoded + samples)
    out.flush()


def main() -> None:
    """Serves the requests on stdin."""
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as out:
        # whatever the library prints goes to stderr, not between the answers
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        serve(json.loads(sys.stdin.buffer.read()), out)


if __name__ == "__main__":
    main()
