"""Opening sound files as streams of blocks: by libsndfile, and what it can't read by ffmpeg."""

from __future__ import annotations

import io
import logging
import os
import shlex
import shutil
import struct
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import open_file
from cospeech.speech.speech import SAMPLE_RATE

READABLE = "wav, flac, ogg or mp3"

DIRECT_SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")
VIDEO_SUFFIXES = (
    ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".wmv", ".flv", ".mpg", ".mpeg", ".mts",
    ".3gp", ".3g2", ".ts", ".m2ts", ".mxf", ".ogv", ".ogm", ".vob", ".qt", ".asf", ".f4v", ".dv",
    ".rm", ".rmvb",
)  # fmt: skip
RAW_SUFFIXES = (".raw", ".pcm")
PACKED_SUFFIXES = tuple(
    f"{suffix}.{packing}" for suffix in DIRECT_SUFFIXES for packing in ("gz", "xz", "bz2", "zip")
)
AUDIO_SUFFIXES = (
    *DIRECT_SUFFIXES,
    ".opus", ".oga", ".aiff", ".aif", ".aifc", ".au", ".snd", ".caf", ".w64",
    ".m4a", ".m4b", ".m4r", ".aac", ".adts", ".wma", ".mka", ".amr", ".3ga", ".ac3", ".eac3",
    ".dts", ".mp2", ".mpa", ".mpga", ".mp1", ".spx", ".weba", ".wv", ".tta", ".ape", ".tak", ".mpc",
    ".alac", ".dsf", ".gsm", ".voc", ".sph", ".nist", ".rf64", ".bwf", ".wave", ".ra",
    *VIDEO_SUFFIXES, *RAW_SUFFIXES, *PACKED_SUFFIXES,
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
    ",ogg,wav,flac,mp3,wv,tta,ape,tak,mpc,mpc8,mxf,dts,dsf,gsm,voc,nistsphere,dv,rm"
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


def libsndfile_name(path: Path) -> str | bytes:
    """A file's name as `soundfile` takes it: it can't encode one that is not UTF-8."""
    return os.fsencode(path) if os.name == "posix" else str(path)


@contextmanager
def open_sound(path: Path) -> Iterator[SoundStream]:
    """The sound of a file.

    What libsndfile doesn't read (m4a, mp4, wma, AAC that is called wav ...) is decoded by ffmpeg,
    where one is installed.

    Raises:
        InputFileError: Neither reads it; the message has the command that converts it.
    """
    try:
        file = _opened(path)
    except (soundfile.SoundFileError, TypeError) as error:
        program = find_ffmpeg()
        if program is None:
            raise _unknown_format(path, error) from error
        with ExitStack() as opened:
            try:
                stream = opened.enter_context(_decoded(path, program))
            except InputFileError:
                if _is_container(path):
                    raise
                raise _unknown_format(path, error) from error
            yield stream
        return
    with file:
        promised = file.frames if file.frames < UNKNOWN_FRAMES else None
        yield SoundStream(file.samplerate, file.channels, promised, _blocks(path, file))


def find_ffmpeg() -> str | None:
    """The ffmpeg that ``IMAGEIO_FFMPEG_EXE`` names, of the extra ``video``, or on the path."""
    programs = [os.environ.get("IMAGEIO_FFMPEG_EXE", "")]
    try:
        import imageio_ffmpeg

        bundled = Path(imageio_ffmpeg.__file__).parent / "binaries"
        programs += map(str, sorted(bundled.glob("ffmpeg*")))
    except ImportError:
        pass
    return next(filter(None, map(shutil.which, filter(None, [*programs, "ffmpeg"]))), None)


def _opened(path: Path) -> _Forward:
    """A file as libsndfile reads it.

    Raises:
        soundfile.SoundFileError, TypeError: It doesn't.
    """
    mended = _with_data_size(path)
    try:
        file = _Forward(libsndfile_name(path))
        if file.format == "MP3" and not _starts_as_mp3(path) and find_ffmpeg() is not None:
            file.close()
            raise TypeError("not MP3 from its start")  # libsndfile finds some in any bytes
        if file.frames or mended is None:
            return file
        file.close()
    except soundfile.SoundFileError:
        if mended is None:
            raise
    return _Forward(mended)


def _starts_as_mp3(path: Path) -> bool:
    with open_file(path) as file:
        head = file.read(3)
    is_layer = len(head) > 1 and head[0] == 0xFF and head[1] & 0xE0 == 0xE0 and head[1] & 0x06 != 0
    return head == b"ID3" or is_layer


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
    """A wav file whose header has no size of the samples, as one that goes on to its end.

    RF64 is read as RIFF then: the sizes in its own chunk are as unknown.
    """
    with open_file(path) as file:
        head = file.read(1 << 16)
    place, is_long = 12, head[:4] == b"RF64"
    is_wav = (is_long or head[:4] == b"RIFF") and head[8:12] == b"WAVE"
    while is_wav and place + 8 <= len(head):
        name, size = struct.unpack_from("<4sI", head, place)
        if name == b"data":
            empty = (size == 0 or is_long) and path.stat().st_size > place + 8
            return _Patched(path, {0: b"RIFF", place + 4: b"\xff" * 4}) if empty else None
        place += 8 + size + size % 2
    return None


class _Patched(io.FileIO):
    """A file some of whose bytes are others: a size of 0xFFFFFFFF is until the end."""

    def __init__(self, path: Path, patches: dict[int, bytes]) -> None:
        super().__init__(path)  # a regular file: its header has been read
        self._patches = patches

    def readinto(self, buffer: Any, /) -> int:
        start = self.tell()
        count = super().readinto(buffer)
        for place, patch in self._patches.items():
            first, stop = max(start, place), min(start + count, place + len(patch))
            if first < stop:
                part = patch[first - place : stop - place]
                memoryview(buffer).cast("B")[first - start : stop - start] = part
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
    with open_file(path) as file:
        head = file.read(12)
    return (
        head[4:8] == b"ftyp"  # MP4 family
        or head[:4] == b"\x1a\x45\xdf\xa3"  # Matroska and WebM
        or path.suffix.lower() in set(AUDIO_SUFFIXES) - {*DIRECT_SUFFIXES, *RAW_SUFFIXES}
    )


def _unknown_format(path: Path, error: Exception) -> InputFileError:
    if path.name.lower().endswith(PACKED_SUFFIXES):
        return InputFileError(path, f"is packed ({path.suffix})", hint="unpack it in its folder")
    if not _is_container(path):
        reason = str(getattr(error, "error_string", error)).rstrip(".")
        problem = f"can't be read as audio ({reason})"
        return InputFileError(path, problem, hint=_conversion(path))
    kind = path.suffix or "MP4 or Matroska"
    return InputFileError(
        path,
        f"this container ({kind}) is not read directly, and no ffmpeg is installed",
        hint=f'pip install "cospeech[video]" brings one; or {_conversion(path)}',
    )


def _conversion(path: Path) -> str:
    suffix = path.suffix.lower()
    other = path.with_suffix(
        ".flac" if suffix == ".wav" else ".wav"
    )  # ffmpeg can't write its input
    source, target = shlex.quote(str(path)), shlex.quote(str(other))
    layout = "-f s16le -ar RATE -ac CHANNELS " if suffix in RAW_SUFFIXES else ""
    command = f"ffmpeg {layout}-i {source} -ac 1 -ar {SAMPLE_RATE} {target}"
    return f"convert it to {READABLE}, e.g. {command}"
