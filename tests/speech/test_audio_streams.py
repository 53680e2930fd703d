"""Sound of unknown length, in containers, that cancels itself out, or that claims to be endless."""

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from cospeech.errors import InputFileError
from cospeech.speech import audio_streams
from cospeech.speech.audio import audio_seconds, load_audio, read_audio

DATA = Path(__file__).resolve().parents[1] / "data"
ffmpeg = pytest.mark.skipif(audio_streams.find_ffmpeg() is None, reason="no ffmpeg is installed")


def tone(seconds=1.0, level=0.5, hz=440.0):
    return level * np.sin(2 * np.pi * hz * np.arange(round(seconds * 16000)) / 16000)


def converted(path: Path, target: Path, *options: str) -> Path:
    command = [audio_streams.find_ffmpeg(), "-v", "error", "-i", path, *options, target]
    subprocess.run(command, check=True)
    return target


# Unknown length -----------------------------------------------------------------------------------


def test_a_flac_stream_of_unknown_length_is_read_to_its_end():
    path = DATA / "wild" / "flac_of_unknown_length" / "pipe_real.flac"
    waveform, oddities = read_audio(path)
    assert len(waveform) == 48000
    assert float(np.sqrt((waveform**2).mean())) == pytest.approx(0.1974, abs=5e-5)
    assert oddities == []
    assert audio_seconds(path) == 3.0


@pytest.mark.parametrize("size", [0, 0xFFFFFFFF, 0x7FFFFFFF])
@pytest.mark.parametrize("channels", [1, 2])
def test_a_wav_stream_of_unknown_length_is_read_to_its_end(tmp_path, size, channels):
    path = tmp_path / "a.wav"
    samples = np.stack([tone()] * channels, axis=1)
    soundfile.write(path, samples, 16000, subtype="PCM_16")
    whole = load_audio(path)
    content = bytearray(path.read_bytes())
    place = content.index(b"data") + 4
    content[place : place + 4] = struct.pack("<I", size)
    content[4:8] = struct.pack("<I", size)
    path.write_bytes(content)
    np.testing.assert_array_equal(load_audio(path), whole)
    assert audio_seconds(path) == 1.0


def test_a_long_wav_stream_of_unknown_length_is_read_to_its_end(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, tone(), 16000, subtype="PCM_16", format="RF64")
    whole = load_audio(path)
    content = bytearray(path.read_bytes())
    place = content.index(b"ds64") + 8
    for size in (0, 2**64 - 1):
        content[place : place + 24] = struct.pack("<Q", size) * 3
        path.write_bytes(content)
        np.testing.assert_array_equal(load_audio(path), whole)


# Containers ---------------------------------------------------------------------------------------


@ffmpeg
@pytest.mark.parametrize("name", ["a.m4a", "b.mp4", "c.mkv", "d.aac", "e.webm"])
def test_containers_are_decoded_by_ffmpeg(tmp_path, name):
    source = tmp_path / "source.wav"
    soundfile.write(source, tone(2.0), 16000)
    path = converted(source, tmp_path / name, "-ar", "48000")
    waveform = load_audio(path)
    assert waveform.dtype == np.float32
    assert len(waveform) == pytest.approx(32000, abs=4000)  # encoders pad both ends
    spectrum = np.abs(np.fft.rfft(waveform[8000:24000]))
    assert spectrum.argmax() == 440  # Hz
    assert float(np.sqrt((waveform[8000:24000] ** 2).mean())) == pytest.approx(0.354, abs=0.03)
    assert audio_seconds(path) == pytest.approx(len(waveform) / 16000)


@ffmpeg
@pytest.mark.parametrize("kind", ["adts", "mp2", "ac3", "wv", "mpegts"])
def test_sound_under_a_wrong_name_is_decoded(tmp_path, kind):
    soundfile.write(tmp_path / "source.wav", tone(2.0), 48000)
    for name in ("a.wav", "a.mp3"):
        path = converted(tmp_path / "source.wav", tmp_path / name, "-f", kind)
        assert len(load_audio(path)) == pytest.approx(32000 / 3, abs=2000)


def test_the_next_decoder_is_taken_where_the_named_one_is_absent(tmp_path, monkeypatch):
    expected = audio_streams.find_ffmpeg()
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nope"))
    assert audio_streams.find_ffmpeg() == expected


@ffmpeg
def test_a_video_without_sound_says_so(tmp_path):
    path = tmp_path / "a.mp4"
    command = [audio_streams.find_ffmpeg(), "-v", "error", "-f", "lavfi", "-i"]
    subprocess.run([*command, "color=black:s=32x32:d=1", path], check=True)
    with pytest.raises(InputFileError, match=r"a\.mp4: has no sound"):
        load_audio(path)


@ffmpeg
def test_what_ffmpeg_can_not_decode_is_named_with_its_reason(tmp_path):
    path = tmp_path / "a.m4a"
    path.write_bytes(b"\0\0\0\x20ftypM4A \0\0\0\0" + bytes(100))
    with pytest.raises(InputFileError, match=r"a\.m4a: ffmpeg can't decode it \("):
        load_audio(path)


@ffmpeg
def test_a_playlist_opens_no_other_file(tmp_path):
    soundfile.write(tmp_path / "secret.wav", tone(), 16000)
    path = tmp_path / "a.m4a"
    for text in ("ffconcat version 1.0\nfile secret.wav\n", "#EXTM3U\n#EXTINF:1,\nsecret.wav\n"):
        path.write_text(text)
        with pytest.raises(InputFileError, match="can't decode it"):
            load_audio(path)


@pytest.mark.skipif(shutil.which("sh") is None, reason="needs a shell")
def test_a_decoder_that_never_ends_is_stopped(tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\nexec sleep 600\n")
    program.chmod(0o755)
    path = tmp_path / "a.m4a"
    path.write_bytes(b"not audio")
    monkeypatch.setattr(audio_streams, "find_ffmpeg", lambda: str(program))
    monkeypatch.setattr(audio_streams, "LONGEST_DECODING_S", 0.2)
    with pytest.raises(InputFileError, match=r"not decoded it within 0\.2 s\n  -> .*ffmpeg -i"):
        load_audio(path)


# Mixes --------------------------------------------------------------------------------------------


def test_channels_that_cancel_out_are_noticed_and_one_is_taken(tmp_path):
    path = tmp_path / "a.wav"
    samples = np.stack([0.9 * tone(), -tone()], axis=1)
    soundfile.write(path, samples, 16000, subtype="FLOAT")
    waveform, (oddity,) = read_audio(path)
    np.testing.assert_array_equal(waveform, samples[:, 1].astype(np.float32))
    assert "cancel each other out" in oddity
    assert "channel 2 of 2 is used alone" in oddity


@pytest.mark.parametrize("other", [0.0, 0.5, -0.2])
def test_channels_that_add_up_are_averaged_as_ever(tmp_path, other):
    path = tmp_path / "a.wav"
    samples = np.stack([tone(), other * tone()], axis=1).astype(np.float32)
    soundfile.write(path, samples, 16000, subtype="FLOAT")
    waveform, oddities = read_audio(path)
    np.testing.assert_array_equal(waveform, samples.mean(axis=1))
    assert oddities == []


def test_silence_in_two_channels_cancels_nothing(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros((16000, 2)), 16000)
    assert read_audio(path)[1] == []


# Bounds -------------------------------------------------------------------------------------------


def test_hours_in_a_few_bytes_are_refused():
    path = DATA / "hostile" / "audio_four_hours_in_45_kB" / "a.flac"
    with pytest.raises(InputFileError, match=r"over 2860 s of sound in 45764 bytes"):
        load_audio(path)


def test_half_an_hour_of_digital_silence_is_read(tmp_path):
    path = tmp_path / "a.flac"
    soundfile.write(path, np.zeros(1600 * 1700, np.int16), 1600)
    assert len(load_audio(path)) == 16000 * 1700


@pytest.mark.slow
def test_four_honest_hours_fit_into_their_samples_and_little_more(tmp_path):
    path = tmp_path / "a.wav"
    with soundfile.SoundFile(path, "w", 16000, 1, "PCM_16") as file:
        minute = np.random.default_rng(0).integers(-3000, 3000, 16000 * 60).astype(np.int16)
        for _ in range(240):
            file.write(minute)
    code = (
        "import resource, sys; from cospeech.speech.audio import load_audio;"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss;"
        "count = len(load_audio(sys.argv[1]));"
        "print(count, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, path], check=True, capture_output=True, text=True
    )
    count, kilobytes = map(int, done.stdout.split())
    assert count == 4 * 3600 * 16000
    assert kilobytes < 1.15 * 4 * count / 1024


def test_an_unreadable_file_is_an_error_about_that_file(tmp_path, monkeypatch):
    path = tmp_path / "a.wav"
    path.symlink_to(tmp_path / "gone.wav")
    with pytest.raises(InputFileError, match=r"a\.wav: no such audio file"):
        load_audio(path)
    path.unlink()
    soundfile.write(path, tone(), 16000)

    def refused(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("cospeech.speech.audio.open_sound", refused)
    with pytest.raises(InputFileError, match=r"a\.wav: can't be read as audio \(Permission denied"):
        load_audio(path)


@pytest.mark.parametrize(
    "name",
    [b"aufnahme_\xfc1.ogg", pytest.param(b"aufnahme_\xfc1.m4a", marks=ffmpeg)],
)
def test_names_that_are_no_utf_8_are_read_like_others(tmp_path, name):
    made = tmp_path / "made.ogg"
    soundfile.write(made, tone(), 16000)
    path = tmp_path / os.fsdecode(name)
    if name.endswith(b"m4a"):
        made = converted(made, tmp_path / "made.m4a")
    made.rename(path)
    waveform, _ = read_audio(path)
    assert len(waveform) == pytest.approx(16000, abs=2048)
    assert audio_seconds(path) == pytest.approx(1.0, abs=0.15)
    path.write_bytes(b"no sound at all")
    with pytest.raises(InputFileError, match=r"can't (be read as audio|decode it) \(") as caught:
        read_audio(path)
    assert "Unicode" not in str(caught.value)
