"""Reading and writing recordings: formats, rates, channels, and files that are no good."""

import logging
import os

import numpy as np
import pytest
import soundfile

from cospeech.errors import InputFileError
from cospeech.speech.audio import audio_seconds, load_audio


def sine(rate, seconds=1.0, hz=440.0, level=0.5):
    return level * np.sin(2 * np.pi * hz * np.arange(round(seconds * rate)) / rate)


def write(path, samples, rate, **options):
    soundfile.write(path, samples, rate, **options)
    return path


@pytest.mark.parametrize("suffix", ["wav", "flac", "ogg", "mp3"])
@pytest.mark.parametrize("rate", [8000, 16000, 22050, 44100, 48000])
def test_any_rate_becomes_the_same_16_khz_signal(tmp_path, suffix, rate):
    path = write(tmp_path / f"a.{suffix}", sine(rate), rate)
    waveform = load_audio(path)
    assert waveform.dtype == np.float32
    assert waveform.shape == (16000,)
    inside = slice(1600, -1600)  # resampling filters ring at the ends
    error = waveform[inside] - sine(16000)[inside]
    assert np.abs(error).max() < {"wav": 1e-3, "flac": 1e-3}.get(suffix, 0.1)


def test_16_khz_is_passed_through_bit_by_bit(tmp_path):
    noise = np.random.default_rng(0).uniform(-1, 1, 50_000).astype(np.float32)
    path = write(tmp_path / "a.wav", noise, 16000, subtype="FLOAT")
    np.testing.assert_array_equal(load_audio(path), noise)


def test_channels_are_averaged(tmp_path):
    left, right = np.full(1000, 0.5), np.full(1000, -0.25)
    path = write(tmp_path / "a.wav", np.stack([left, right], axis=1), 16000, subtype="FLOAT")
    np.testing.assert_allclose(load_audio(path), 0.125)


def test_reading_in_blocks_has_no_seams(tmp_path, monkeypatch):
    path = write(tmp_path / "a.wav", sine(44100), 44100)
    whole = load_audio(path)
    monkeypatch.setattr("cospeech.speech.audio_streams._BLOCK_VALUES", 1000)
    np.testing.assert_allclose(load_audio(path), whole, atol=1e-7)


def test_overshoot_is_clipped_but_integers_as_floats_are_refused(tmp_path):
    path = write(tmp_path / "a.wav", sine(16000, level=1.2), 16000, subtype="FLOAT")
    assert np.abs(load_audio(path)).max() == 1.0
    path = write(tmp_path / "b.wav", sine(16000, level=20000), 16000, subtype="FLOAT")
    with pytest.raises(InputFileError, match=r"reach 20000, but full scale is 1\n  -> .*32768"):
        load_audio(path)


def test_nan_is_placed(tmp_path):
    samples = sine(16000)
    samples[4000] = np.nan
    path = write(tmp_path / "a.wav", samples, 16000, subtype="FLOAT")
    with pytest.raises(InputFileError, match=r"a\.wav, at 0\.250 s: holds NaN"):
        load_audio(path)


def test_no_such_file_and_no_file(tmp_path):
    with pytest.raises(InputFileError, match=r"none\.wav: no such audio file"):
        load_audio(tmp_path / "none.wav")
    with pytest.raises(InputFileError, match="is not a file"):
        load_audio(tmp_path)


def test_empty_files(tmp_path):
    (tmp_path / "a.wav").touch()
    with pytest.raises(InputFileError, match="0 bytes"):
        load_audio(tmp_path / "a.wav")
    path = write(tmp_path / "b.wav", np.zeros(0), 16000)
    with pytest.raises(InputFileError, match="no audio samples"):
        load_audio(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("talk.m4a", b"\0\0\0\x20ftypM4A \0\0\0\0" + bytes(100)),
        ("talk.wav", b"\0\0\0\x20ftypisom\0\0\0\0" + bytes(100)),
        ("my talk.webm", b"\x1a\x45\xdf\xa3" + bytes(100)),
        ("talk.mp4", b"anything"),
    ],
)
def test_containers_come_with_the_command_that_converts_them(tmp_path, monkeypatch, name, content):
    monkeypatch.setattr("cospeech.speech.audio_streams.find_ffmpeg", lambda: None)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(
        InputFileError, match=r"ffmpeg -i .* -ac 1 -ar 16000 .*talk\.(wav|flac)'?$"
    ) as caught:
        load_audio(tmp_path / name)
    assert "not read directly" in str(caught.value)
    assert str(caught.value.hint).count(name) == 1  # ffmpeg can't write what it reads
    assert ("'" in str(caught.value.hint)) == (" " in name)  # quoted where the shell needs it


@pytest.mark.parametrize("name", ["a.wav", "a.flac", "a.raw", "a"])
def test_other_content_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"these are not samples " * 50)
    with pytest.raises(InputFileError, match=r"can't be read as audio \(.*\n  -> convert it to"):
        load_audio(tmp_path / name)


def test_too_long(tmp_path):
    path = write(tmp_path / "a.wav", np.zeros(16000 * 3), 16000)
    assert len(load_audio(path, max_duration_s=3.0)) == 48000
    with pytest.raises(InputFileError, match=r"is longer than .* h\n  -> cut it"):
        load_audio(path, max_duration_s=2.9)


def test_a_header_that_promises_more_allocates_nothing(tmp_path, caplog):
    path = write(tmp_path / "a.wav", sine(16000), 16000)
    content = bytearray(path.read_bytes())
    place = content.index(b"data") + 4
    content[place : place + 4] = b"\xfe\xff\xff\x7f"
    path.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        assert len(load_audio(path)) == 16000


def test_a_cut_off_flac_names_the_second(tmp_path):
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, 16000 * 4)
    path = write(tmp_path / "a.flac", noise, 16000)
    path.write_bytes(path.read_bytes()[:-60000])
    with pytest.raises(InputFileError, match=r"a\.flac, at \d+\.\d s: is damaged"):
        load_audio(path)


def test_absurd_sample_rate(tmp_path):
    path = write(tmp_path / "a.wav", np.zeros(100), 10)
    with pytest.raises(InputFileError, match="claims a sample rate of 10 Hz"):
        load_audio(path)


def test_real_recordings_have_their_known_lengths(shared):
    speech = shared / "data/real/speech"
    seconds = {
        "librispeech/2412-153948-0000.flac": 11.66,
        "librispeech/61-70968-0000.flac": 4.905,
        "ami/ES2011a.Headset-0-40s-46s.wav": 6.0,
        "jfk/jfk.flac": 11.0,  # 44.1 kHz, stereo, 24 bit
    }
    for name, expected in seconds.items():
        waveform = load_audio(speech / name)
        assert len(waveform) / 16000 == pytest.approx(expected, abs=0.006)
        assert 0.05 < np.abs(waveform).max() <= 1.0


def test_a_pipe_has_no_length(tmp_path):
    os.mkfifo(tmp_path / "a.wav")  # whose opening would wait for a writer for ever
    with pytest.raises(InputFileError, match="is not a file"):
        audio_seconds(tmp_path / "a.wav")
