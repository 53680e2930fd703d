import builtins
import re
import subprocess

import numpy as np
import pytest

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.drawing import FigurePainter
from cospeech.reporting.framing import extents
from cospeech.reporting.projection import Camera
from cospeech.reporting.video import subtitle_lines, write_mp4
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the video extra is not installed")


@pytest.fixture
def raised(rest):
    """The left arm goes up at frame 15 of 30."""
    positions = np.repeat(rest[None], 30, axis=0)
    positions[15:, 5] = [0.45, 0.6, 0]
    positions[15:, 6] = [0.45, 0.85, 0]
    return Motion(UPPER_BODY, 15.0, positions)


@pytest.fixture
def speech():
    tone = 0.3 * np.sin(2 * np.pi * 220 * np.arange(2 * SAMPLE_RATE) / SAMPLE_RATE)
    return Speech(tone.astype(np.float32), (Word("hello", 0.2, 0.6), Word("there", 0.6, 1.9)))


def camera_of(motion):
    """The camera of a 640 x 480 picture, drawn at twice that, its last 14 % left to subtitles."""
    return Camera(motion, (1280, 960 - round(0.14 * 960)), extents({"a": motion})["a"])


def probe(path, *arguments):
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), *arguments]
    return subprocess.run(command, capture_output=True, check=False)


def frames_of(path, size):
    done = probe(path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-loglevel", "error", "-")
    return np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, size[1], size[0], 3).astype(int)


def is_orange(pixel):
    return pixel[0] - pixel[2] > 60


def test_picture_has_the_left_wrist_where_the_camera_sees_it(raised):
    size = (640, 480)
    camera = camera_of(raised)
    for frame in (0, 29):
        picture = np.asarray(
            FigurePainter({"recorded": raised}, size).paint(frame / 15, ())
        ).astype(int)
        seen = camera.project(raised.positions[frame], frame).pixels / 2
        wrist = seen[6].round().astype(int)
        assert is_orange(picture[wrist[1], wrist[0]])
        elbow_to_wrist = ((seen[5] + seen[6]) / 2).round().astype(int)
        assert is_orange(picture[elbow_to_wrist[1], elbow_to_wrist[0]])
        right = seen[9].round().astype(int)
        pixel = picture[right[1], right[0]]
        assert pixel[2] - pixel[0] > 60


def test_a_nearer_bone_covers_a_farther_one(rest):
    # both wrists on the line of sight's way: the left one 0.4 m in front of the right one
    positions = np.repeat(rest[None], 2, axis=0)
    camera = camera_of(Motion(UPPER_BODY, 15, positions))
    toward = camera._axes[2]
    positions[:, 9] = positions[:, 6] - 0.4 * toward
    motion = Motion(UPPER_BODY, 15, positions)
    picture = np.asarray(FigurePainter({"a": motion}, (640, 480)).paint(0, ())).astype(int)
    seen = camera_of(motion).project(positions[0], 0)
    assert seen.depth[6] < seen.depth[9]
    at = (seen.pixels[6] / 2).round().astype(int)
    assert is_orange(picture[at[1], at[0]])


def test_video_has_the_frames_the_sound_and_the_motion(raised, speech, tmp_path):
    size = (480, 320)
    path = write_mp4(tmp_path / "v.mp4", {"recorded": raised}, speech, size)
    said = probe(path).stderr.decode()
    assert re.search(r"Duration: 00:00:02\.0", said)
    assert re.search(r"Video: h264.*yuv420p.*480x320.* 15 fps", said)
    assert re.search(r"Audio: aac", said)
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # plays before it is all there
    frames = frames_of(path, size)
    assert len(frames) == 30
    rows = [np.nonzero((f[..., 0] - f[..., 2] > 60).any(axis=1))[0] for f in frames]
    tops = np.array([row.min() for row in rows])
    # the arm is up from frame 15 on, and not before
    assert np.ptp(tops[:15]) <= 2
    assert tops[14] - tops[15] > 30
    assert list(tmp_path.iterdir()) == [path]


def test_video_lasts_as_long_as_the_longest_part(raised, tmp_path):
    silent = Speech(np.zeros(0, dtype=np.float32))
    path = write_mp4(
        tmp_path / "v.mp4", {"a": raised, "b": raised.slice(0, 10)}, silent, (320, 200)
    )
    assert len(frames_of(path, (320, 200))) == 30
    assert b"Audio" not in probe(path).stderr
    long = Speech(np.zeros(3 * SAMPLE_RATE, dtype=np.float32))
    path = write_mp4(tmp_path / "w.mp4", {"a": raised}, long, (320, 200))
    assert len(frames_of(path, (320, 200))) == 45


def test_subtitles_break_at_pauses_and_length():
    words = [Word("word", 0.3 * i, 0.3 * i + 0.3) for i in range(12)]
    words += [Word("late", 9.0, 9.3)]
    lines = subtitle_lines(tuple(words))
    # nine words of four letters and a space each fill 44 characters: 8 * 5 + 4
    assert [len(line) for line in lines] == [9, 3, 1]


def test_wrong_sizes_and_a_missing_extra_are_named(raised, speech, tmp_path, monkeypatch):
    with pytest.raises(CospeechError, match="even"):
        write_mp4(tmp_path / "v.mp4", {"a": raised}, speech, (481, 320))
    real_import = builtins.__import__

    def without_ffmpeg(name, *args, **kwargs):
        if name == "imageio_ffmpeg":
            raise ImportError(name)
        return real_import(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_ffmpeg)
    with pytest.raises(CospeechError, match=r'pip install "cospeech\[video\]"'):
        write_mp4(tmp_path / "v.mp4", {"a": raised}, speech)
    assert list(tmp_path.iterdir()) == []


def test_failing_ffmpeg_leaves_the_old_file_and_says_why(raised, speech, tmp_path, monkeypatch):
    script = tmp_path / "ffmpeg"
    script.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    script.chmod(0o755)
    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", lambda: str(script))
    path = tmp_path / "v.mp4"
    path.write_bytes(b"old")
    with pytest.raises(CospeechError, match="code 3: no such codec"):
        write_mp4(path, {"a": raised}, speech, (320, 200))
    assert path.read_bytes() == b"old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ffmpeg", "v.mp4"]
