"""Opening sound files as streams of blocks: by libsndfile, and what it can't read by ffmpeg."""

from __future__ import annotations

import io
import logging
import shlex
import shutil
import struct
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.speech.speech import SAMPLE_RATE

READABLE = "wav, flac, ogg or mp3"

DIRECT_SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")
VIDEO_SUFFIXES = (
    ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".wmv", ".flv", ".mpg", ".mpeg", ".mts",
    ".3gp",
)  # fmt: skip
AUDIO_SUFFIXES = (
    *DIRECT_SUFFIXES,
    ".opus", ".oga", ".aiff", ".aif", ".aifc", ".au", ".snd", ".caf", ".w64",
    ".m4a", ".aac", ".wma", ".mka", ".amr", ".ac3",
    *VIDEO_SUFFIXES,
)  # fmt: skip
"""What may hold sound, the preferred first; those that libsndfile can't open need ffmpeg."""

UNKNOWN_FRAMES = 1 << 60
"""libsndfile gives at least so many frames to a file whose header doesn't say how long it is."""

LONGEST_DECODING_S = 900.0
"""ffmpeg is given so long, s; four hours of AAC take it a minute or two."""

_log = logging.getLogger(__name__)

_AU_HEADER = struct.Struct(">4s5I")  # magic, start of the samples, bytes, encoding, rate, channels

_BLOCK_VALUES = 1 << 20  # frames times channels per read: a hostile header can't make us allocate
# No playlist or script, which could name other files.
_DEMUXERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,aac,asf,avi,flv,mpeg,mpegts,amr,ac3,eac3,caf,aiff,au,w64"
    ",ogg,wav,flac,mp3"
)


@dataclass(frozen=True)
class SoundStream:
    """A sound file being read from its start to its end.

    Attributes:
        rate: Frames per second.
        channels: Values per frame.
        promised: Frames by its header; None where that doesn't say.
        blocks: ``(n, channels)`` float32 each.
    """

    rate: int
    channels: int
    promised: int | None
    blocks: Iterator[NDArray[np.float32]]


@contextmanager
def open_sound(path: Path) -> Iterator[SoundStream]:
    """The sound of a file.

    Containers that libsndfile doesn't read (m4a, mp4, wma ...) are decoded by ffmpeg, where one is
    installed.

    Raises:
        InputFileError: Neither reads it; the message has the command that converts it.
    """
    try:
        file = _Forward(path)
        if file.frames == 0 and (mended := _with_data_size(path)) is not None:
            file.close()
            file = _Forward(mended)
    except (soundfile.SoundFileError, TypeError) as error:
        program = find_ffmpeg()
        if program is None or not _is_container(path):
            raise _unknown_format(path, error) from error
        with _decoded(path, program) as stream:
            yield stream
        return
    with file:
        promised = file.frames if file.frames < UNKNOWN_FRAMES else None
        yield SoundStream(file.samplerate, file.channels, promised, _blocks(path, file))


def find_ffmpeg() -> str | None:
    """The ffmpeg of the extra ``video``, else the one on the path."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError, OSError):
        return shutil.which("ffmpeg")


class _Forward(soundfile.SoundFile):
    """A file that is never sought in: where the length is unknown, seeking fails."""

    def seekable(self) -> bool:
        return False


def _blocks(path: Path, file: soundfile.SoundFile) -> Iterator[NDArray[np.float32]]:
    frames = max(1, _BLOCK_VALUES // file.channels)
    done = 0
    while True:
        try:
            block = file.read(frames, dtype="float32", always_2d=True)
        except soundfile.SoundFileError as error:
            raise InputFileError(
                path,
                f"is damaged ({error})",
                place=f"at {done / file.samplerate:.1f} s",
                hint="copy or download it again",
            ) from error
        done += len(block)
        yield block
        if len(block) < frames:
            return


def _with_data_size(path: Path) -> io.RawIOBase | None:
    """A wav file whose header has no size of the samples, as one that goes on to its end."""
    with path.open("rb") as file:
        head = file.read(1 << 16)
    place = 12
    while head[:4] == b"RIFF" and head[8:12] == b"WAVE" and place + 8 <= len(head):
        name, size = struct.unpack_from("<4sI", head, place)
        if name == b"data":
            empty = size == 0 and path.stat().st_size > place + 8
            return _UntilTheEnd(path, place + 4) if empty else None
        place += 8 + size + size % 2
    return None


class _UntilTheEnd(io.FileIO):
    """A file in which the four bytes of a size are 0xFFFFFFFF: until the end."""

    def __init__(self, path: Path, size_at: int) -> None:
        super().__init__(path)
        self._size_at = size_at

    def readinto(self, buffer: Any, /) -> int:
        start = self.tell()
        count = super().readinto(buffer)
        first, stop = max(start, self._size_at), min(start + count, self._size_at + 4)
        if first < stop:
            memoryview(buffer).cast("B")[first - start : stop - start] = b"\xff" * (stop - first)
        return count


@contextmanager
def _decoded(path: Path, program: str) -> Iterator[SoundStream]:
    """What ffmpeg makes of a file, at 16 kHz, as au: a fixed header and samples until the end."""
    command = [
        program, "-nostdin", "-v", "error", "-max_alloc", str(1 << 28),
        "-protocol_whitelist", "file", "-format_whitelist", _DEMUXERS, "-i", f"file:{path}",
        "-map", "0:a:0", "-ar", str(SAMPLE_RATE), "-c:a", "pcm_f32be", "-f", "au", "pipe:1",
    ]  # fmt: skip
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said)
        assert process.stdout is not None
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(LONGEST_DECODING_S, stop)
        timer.daemon = True
        timer.start()
        try:
            header = process.stdout.read(_AU_HEADER.size)
            if len(header) < _AU_HEADER.size:
                raise _undecoded(path, process, said, late)
            start, rate, channels = (_AU_HEADER.unpack(header)[i] for i in (1, 4, 5))
            process.stdout.read(start - _AU_HEADER.size)
            blocks = _pipe_blocks(path, process, said, late, channels)
            yield SoundStream(rate, channels, None, blocks)
        finally:
            timer.cancel()
            process.kill()
            process.stdout.close()
            process.wait()


def _pipe_blocks(
    path: Path,
    process: subprocess.Popen[bytes],
    said: IO[bytes],
    late: threading.Event,
    channels: int,
) -> Iterator[NDArray[np.float32]]:
    assert process.stdout is not None
    frame_bytes = 4 * channels
    block_bytes = max(1, _BLOCK_VALUES // channels) * frame_bytes
    while len(data := process.stdout.read(block_bytes)) >= frame_bytes:
        whole = data[: len(data) // frame_bytes * frame_bytes]
        yield np.frombuffer(whole, np.dtype(">f4")).astype(np.float32).reshape(-1, channels)
    if process.wait() != 0 or late.is_set():
        error = _undecoded(path, process, said, late)
        if late.is_set():
            raise error
        _log.warning("%s is used as far as it was decoded", error.problem)


def _undecoded(
    path: Path, process: subprocess.Popen[bytes], said: IO[bytes], late: threading.Event
) -> InputFileError:
    """Why ffmpeg has ended without a sound."""
    code = process.wait()
    if late.is_set():
        problem = f"ffmpeg has not decoded it within {LONGEST_DECODING_S:g} s"
        return InputFileError(path, problem, hint=_conversion(path))
    said.seek(0)
    lines = said.read(1 << 16).decode("utf-8", "replace").strip().splitlines()
    if any("matches no streams" in line for line in lines):
        return InputFileError(path, "has no sound", hint="keep it in another folder")
    reason = lines[-1][:200] if lines else f"code {code}"
    hint = "copy it again, or export its sound as wav"
    return InputFileError(path, f"ffmpeg can't decode it ({reason})", hint=hint)


def _is_container(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(12)
    return (
        head[4:8] == b"ftyp"  # MP4 family
        or head[:4] == b"\x1a\x45\xdf\xa3"  # Matroska and WebM
        or path.suffix.lower() in set(AUDIO_SUFFIXES) - set(DIRECT_SUFFIXES)
    )


def _unknown_format(path: Path, error: Exception) -> InputFileError:
    if not _is_container(path):
        reason = f"can't be read as audio ({str(error).rstrip('.')})"
        return InputFileError(path, reason, hint=_conversion(path))
    kind = path.suffix or "MP4 or Matroska"
    return InputFileError(
        path,
        f"this container ({kind}) is not read directly, and no ffmpeg is installed",
        hint=f'pip install "cospeech[video]" brings one; or {_conversion(path)}',
    )


def _conversion(path: Path) -> str:
    source, target = shlex.quote(str(path)), shlex.quote(str(path.with_suffix(".wav")))
    command = f"ffmpeg -i {source} -ac 1 -ar {SAMPLE_RATE} {target}"
    return f"convert it to {READABLE}, e.g. {command}"
