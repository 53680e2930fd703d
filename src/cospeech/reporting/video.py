"""Stick-figure video with sound and subtitles."""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cospeech.errors import CospeechError
from cospeech.files import replacing
from cospeech.motion.motion import Motion
from cospeech.reporting.drawing import FigurePainter
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

_LINE_CHARACTERS = 44
_PAUSE_S = 0.7
_LINGER_S = 0.5
_MAX_FPS = 60.0


def subtitle_lines(words: tuple[Word, ...]) -> list[tuple[Word, ...]]:
    """Words in lines of at most 44 characters, broken at pauses of 0.7 s too."""
    lines: list[list[Word]] = []
    for word in words:
        line = lines[-1] if lines else []
        used = sum(len(earlier.text) + 1 for earlier in line)
        if (
            not line
            or used + len(word.text) > _LINE_CHARACTERS
            or word.start - line[-1].end > _PAUSE_S
        ):
            lines.append([word])
        else:
            line.append(word)
    return [tuple(line) for line in lines]


def _line_at(lines: list[tuple[Word, ...]], time: float) -> tuple[Word, ...]:
    started = [line for line in lines if line[0].start <= time + 1e-6]
    if started and time < started[-1][-1].end + _LINGER_S:
        return started[-1]
    return ()


def write_mp4(
    path: str | Path,
    tracks: Mapping[str, Motion],
    speech: Speech,
    size: tuple[int, int] = (1280, 720),
) -> Path:
    """Write an MP4 (H.264, AAC) of tracks side by side with the speech and its words.

    The video runs at the highest frame rate of the tracks (at most 60) and lasts as long as the
    longest of motion and speech; each track shows its own frame of that time.

    Args:
        path: The file; replaced only when the new one is complete.
        tracks: Label -> motion.
        speech: Sound; without samples the video is silent.
        size: Width and height in pixels, both even.

    Returns:
        ``path``.

    Raises:
        CospeechError: The ``video`` extra is missing, a size is odd, a motion is empty or not
            finite, or ffmpeg fails.
    """
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise CospeechError(
            "video needs Pillow and imageio-ffmpeg", 'pip install "cospeech[video]"'
        ) from error
    if size[0] % 2 or size[1] % 2:
        raise CospeechError(f"video of {size[0]} x {size[1]} pixels", "H.264 needs even numbers")
    painter = FigurePainter(tracks, size)
    fps = min(max(motion.fps for motion in tracks.values()), _MAX_FPS)
    duration = max(speech.duration, *(motion.duration for motion in tracks.values()))
    frames = max(1, math.ceil(duration * fps - 1e-6))
    lines = subtitle_lines(speech.words or ())
    with (
        replacing(path) as target,
        tempfile.TemporaryDirectory(prefix="cospeech-video-") as folder,
        tempfile.TemporaryFile() as messages,
    ):
        sound = _write_sound(Path(folder) / "speech.wav", speech, frames / fps)
        command = [
            imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error",
            "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}",
            "-r", f"{fps:.6f}", "-i", "-",
            *([] if sound is None else ["-i", str(sound), "-c:a", "aac", "-b:a", "96k"]),
            "-c:v", "libx264", "-preset", "veryfast", "-crf", "18", "-pix_fmt", "yuv420p",
            "-movflags", "+faststart", "-f", "mp4", str(target),
        ]  # fmt: skip
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=messages
        )
        assert process.stdin is not None
        try:
            for i in range(frames):
                picture = painter.paint(i / fps, _line_at(lines, i / fps))
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # ffmpeg gave up; its own message says why
        except BaseException:
            process.kill()
            raise
        finally:
            code = process.wait()
        if code != 0:
            messages.seek(0)
            reason = messages.read().decode("utf-8", "replace").strip().splitlines()[-3:]
            raise CospeechError(f"{path}: ffmpeg ended with code {code}: {' | '.join(reason)}")
    return Path(path)


def _write_sound(path: Path, speech: Speech, seconds: float) -> Path | None:
    """The speech as a WAV, padded with silence to the video's length; None without samples."""
    import soundfile

    if not len(speech.waveform):
        return None
    missing = max(0, math.ceil(seconds * SAMPLE_RATE) - len(speech.waveform))
    soundfile.write(path, np.pad(speech.waveform, (0, missing)), SAMPLE_RATE, subtype="PCM_16")
    return path
