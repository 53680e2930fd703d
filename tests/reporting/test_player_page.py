import base64
import hashlib
import io
import json
import re
from importlib.resources import files

import numpy as np
import pytest
import soundfile

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.reporting.player.encode import encode_phases, encode_positions
from cospeech.reporting.player.page import script_safe_json
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word


def decoded(track):
    integers = np.frombuffer(base64.b64decode(track["data"]), dtype="<i2")
    integers = integers.reshape(track["frames"], track["joints"], 3)
    return np.array(track["origin"]) + track["quantum"] * integers


def page_values(path):
    text = path.read_text(encoding="utf-8")
    found = re.findall(r'<script type="application/json" id="cospeech-data">(.*?)</script>', text)
    assert len(found) == 1
    return json.loads(found[0])


@pytest.fixture
def clip():
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(45, 10, 3)).astype(np.float32)
    waveform = np.zeros(3 * SAMPLE_RATE, dtype=np.float32)
    waveform[SAMPLE_RATE : SAMPLE_RATE + 80] = 0.5
    words = (Word("hello", 0.5, 0.9), Word("</script><script>alert(1)</script>", 1.0, 1.4))
    return PlayerClip(
        "a </script> & b",
        {"recorded": Motion(UPPER_BODY, 15, positions)},
        Speech(waveform, words),
        {"recorded": ["none"] * 15 + ["stroke"] * 30},
        {"<img src=x onerror=alert(1)>": "</table>"},
    )


def test_positions_come_back_within_a_millimetre(clip, tmp_path):
    track = page_values(write_player(tmp_path / "p.html", [clip], "t"))["clips"][0]["tracks"][0]
    error = np.abs(decoded(track) - clip.tracks["recorded"].positions)
    assert error.max() < 1e-3
    # 16 bits over an extent of about 8 m
    assert error.max() < 0.6 * 8 / 65534 + 1e-6


@pytest.mark.parametrize("centre", [0.0, 400.0])
def test_a_walk_across_a_hall_stays_within_a_millimetre(centre):
    walk = np.zeros((100, 10, 3), dtype=np.float32)
    walk[:, :, 0] = np.linspace(-50, 50, 100)[:, None] + centre
    values = encode_positions(walk)
    integers = np.frombuffer(base64.b64decode(values["data"]), dtype="<i2").reshape(walk.shape)
    back = np.array(values["origin"]) + values["quantum"] * integers
    assert np.abs(back - walk).max() < 1e-3


def test_sound_keeps_its_length_and_place(clip, tmp_path):
    audio = page_values(write_player(tmp_path / "p.html", [clip], "t"))["clips"][0]["audio"]
    samples, rate = soundfile.read(io.BytesIO(base64.b64decode(audio["data"])))
    assert (rate, len(samples), audio["samples"]) == (SAMPLE_RATE, 48000, 48000)
    assert abs(int(np.abs(samples).argmax()) - SAMPLE_RATE) < 100
    assert len(audio["data"]) < 2 * 48000 / 4  # a quarter of 16-bit PCM at most


def test_phases_become_runs():
    assert encode_phases(["none", "stroke", "stroke", "hold"], 10) == [
        [0.0, 0.1, "none"],
        [0.1, 0.3, "stroke"],
        [0.3, 0.4, "hold"],
    ]


def test_strings_cannot_leave_the_data_element(clip, tmp_path):
    text = write_player(tmp_path / "p.html", [clip], "<b>title</b>", "</script>notes").read_text()
    assert text.count("</script>") == 2  # the data's and the program's own
    assert "alert(1)</" not in text
    assert "<b>title" not in text
    values = page_values(tmp_path / "p.html")
    assert values["clips"][0]["words"][1][0] == "</script><script>alert(1)</script>"
    assert values["clips"][0]["name"] == "a </script> & b"
    assert "\u2028" not in script_safe_json("a\u2028b")
    assert json.loads(script_safe_json("a\u2028<b>")) == "a\u2028<b>"


def test_page_refers_to_nothing_outside(clip, tmp_path):
    text = write_player(tmp_path / "p.html", [clip], "t").read_text()
    assert "default-src 'none'" in text
    assert not re.search(r"(?:src|href|action)\s*=\s*[\"']?(?:https?:)?//", text)
    assert not re.search(
        r"url\(|@import|importScripts|XMLHttpRequest\(\)\.open", text.split("<body>")[0]
    )
    # namespaces are names, not addresses
    urls = set(re.findall(r"https?://[\w./-]+", text))
    assert urls <= {"http://www.w3.org/1999/xhtml", "http://www.w3.org/2000/svg"}


def test_bundle_was_built_from_these_sources():
    folder = files("cospeech.reporting.player")
    digest = hashlib.sha256()
    sources = sorted((f for f in (folder / "src").iterdir()), key=lambda f: f.name)
    for source in [*sources, folder / "package.json"]:
        digest.update(source.read_text(encoding="utf-8").encode())
    head = (folder / "player.bundle.js").read_text(encoding="utf-8")[:100]
    # after a change: npm install --no-package-lock && npm run build, in the player's folder
    assert head.startswith(f"/* sources {digest.hexdigest()} */")


def test_bundle_keeps_the_licence_and_stays_small(clip, tmp_path):
    text = write_player(tmp_path / "p.html", [clip], "t").read_text()
    assert re.search(r"@license\s+\*? ?Copyright 2010-\d+ Three\.js Authors", text)
    assert (tmp_path / "p.html").stat().st_size < 1_000_000


def test_wrong_input_is_refused_and_the_old_page_stays(clip, tmp_path):
    path = tmp_path / "p.html"
    path.write_text("old")
    motion = clip.tracks["recorded"]
    with pytest.raises(CospeechError, match="no clips"):
        write_player(path, [], "t")
    short = PlayerClip("c", clip.tracks, clip.speech, {"recorded": ["none"] * 44})
    with pytest.raises(CospeechError, match="44 phase labels for 45 frames"):
        write_player(path, [short], "t")
    unknown = PlayerClip("c", clip.tracks, clip.speech, {"generated": ["none"] * 45})
    with pytest.raises(CospeechError, match="generated"):
        write_player(path, [unknown], "t")
    bad = motion.positions.copy()
    bad[3, 2] = np.inf
    infinite = PlayerClip("c", {"generated": Motion(UPPER_BODY, 15, bad)}, clip.speech)
    with pytest.raises(CospeechError, match="frame 3, joint nose"):
        write_player(path, [infinite], "t")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_clip_lasts_as_long_as_its_longest_part(clip, tmp_path):
    long = Motion(UPPER_BODY, 10, np.ones((50, 10, 3), dtype=np.float32))
    silent = PlayerClip("s", {"a": long}, Speech(np.zeros(0, dtype=np.float32)))
    values = page_values(write_player(tmp_path / "p.html", [clip, silent], "t"))
    assert [c["duration"] for c in values["clips"]] == [3.0, 5.0]
    assert values["clips"][1]["audio"] is None
    assert values["clips"][1]["words"] is None
