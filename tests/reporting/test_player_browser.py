"""The player page in a real browser, opened from disk."""

import io
import shutil
import time

import numpy as np
import pytest

from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.player import PlayerClip, write_player
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
Image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

FPS = 15.0
RAISED_AT_S = 2.0
CLICK_AT_S = 2.5
SIZE = {"width": 1280, "height": 800}


@pytest.fixture(scope="module")
def page_path(tmp_path_factory, rest):
    """Recorded: the left arm goes up at 2 s. Generated: nothing moves."""
    recorded = np.repeat(rest[None], 60, axis=0)
    up = round(RAISED_AT_S * FPS)
    recorded[up:, 5] = [0.45, 0.6, 0]
    recorded[up:, 6] = [0.45, 0.85, 0]
    waveform = np.zeros(4 * SAMPLE_RATE, dtype=np.float32)
    at = round(CLICK_AT_S * SAMPLE_RATE)
    waveform[at : at + 64] = 0.8 * np.sin(np.arange(64))
    words = (Word("one", 0.5, 1.0), Word("</script>two", 1.0, 1.6), Word("three", 2.4, 3.0))
    tracks = {
        "recorded": Motion(UPPER_BODY, FPS, recorded),
        "generated": Motion(UPPER_BODY, FPS, np.repeat(rest[None], 60, axis=0)),
    }
    phases = {"recorded": ["none"] * up + ["stroke"] * (60 - up)}
    clip = PlayerClip("first", tracks, Speech(waveform, words), phases, {"seed": "1"})
    other = PlayerClip("second", {"only": tracks["generated"]}, Speech(waveform[:SAMPLE_RATE]))
    path = tmp_path_factory.mktemp("player") / "player.html"
    return write_player(path, [clip, other], "A title", "Notes.")


# the page leaves WebGL alone where it is done in software, as it is on a machine for tests
PRETEND_HARDWARE = """
const real = WebGL2RenderingContext.prototype.getParameter;
WebGL2RenderingContext.prototype.getParameter = function (name) {
  return name === 0x9246 ? "Some GPU" : real.call(this, name);
};
"""


class Opened:
    """A page with what it said and asked for."""

    def __init__(self, browser, path, webgl=False):
        self.page = browser.new_page(viewport=SIZE, color_scheme="light")
        if webgl:
            self.page.add_init_script(PRETEND_HARDWARE)
        self.problems, self.requests = [], []
        self.page.on("console", lambda m: m.type == "error" and self.problems.append(m.text))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.evaluate("cospeechPlayer.ready")

    def js(self, expression):
        return self.page.evaluate(expression)

    def wait(self, condition, seconds=60):
        """Like wait_for_function, which the page's policy against evaluated strings forbids."""
        end = time.monotonic() + seconds
        while not self.js(condition):
            assert time.monotonic() < end, f"not within {seconds} s: {condition}"
            self.page.wait_for_timeout(20)

    def show(self, at):
        self.js(f"cospeechPlayer.seek({at})")
        self.wait(f"Math.abs(cospeechPlayer.shownTime - {at}) < 1e-4")
        self.refresh()

    def refresh(self):
        """Wait until what the page knows by now is on screen."""
        self.js("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def pixels(self):
        box = self.page.locator("#view").bounding_box()
        image = Image.open(io.BytesIO(self.page.screenshot(clip=box))).convert("RGB")
        return np.asarray(image).astype(int)


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, page_path):
    opened = Opened(browser, page_path)
    yield opened
    opened.page.close()


def orange(pixels):
    """Where the left arm's colour (#f0883e, shaded) is."""
    red, green, blue = np.moveaxis(pixels, -1, 0)
    return (red > 90) & (red - blue > 70) & (red > 1.2 * green)


def blue(pixels):
    red, _, blue = np.moveaxis(pixels, -1, 0)
    return (blue > 90) & (blue - red > 70)


def height_of(mask):
    return np.nonzero(mask)[0].mean()


def check_arm_goes_up(opened):
    opened.show(1.0)
    before = opened.pixels()
    opened.show(3.0)
    after = opened.pixels()
    half = before.shape[1] // 2
    for picture in (before, after):
        for side in (picture[:, :half], picture[:, half:]):
            assert orange(side).sum() > 800
            assert blue(side).sum() > 800
    recorded_before, recorded_after = before[:, :half], after[:, :half]
    assert height_of(orange(recorded_before)) - height_of(orange(recorded_after)) > 60
    assert abs(height_of(blue(recorded_before)) - height_of(blue(recorded_after))) < 4
    # a facing person's left arm is on the viewer's right
    assert (
        np.nonzero(orange(recorded_before))[1].mean() > np.nonzero(blue(recorded_before))[1].mean()
    )
    # what does not move is drawn alike at both times
    labels_end = 40
    np.testing.assert_array_equal(before[labels_end:, half + 2 :], after[labels_end:, half + 2 :])


def test_skeletons_are_drawn_and_move(opened):
    assert opened.js("document.getElementById('view').getContext('2d') !== null")
    check_arm_goes_up(opened)
    assert opened.problems == []


def test_skeletons_are_drawn_and_move_in_webgl(browser, page_path):
    opened = Opened(browser, page_path, webgl=True)
    assert opened.js("document.getElementById('view').getContext('webgl2') !== null")
    check_arm_goes_up(opened)
    assert opened.problems == []
    opened.page.close()


def test_seeking_moves_frame_word_and_labels(opened):
    opened.show(0.7)
    assert opened.js("cospeechPlayer.frame") == 10  # floor(0.7 * 15)
    assert opened.page.locator("#words .current").all_inner_texts() == ["one"]
    opened.show(1.0)
    assert opened.page.locator("#words .current").all_inner_texts() == ["</script>two"]
    opened.show(2.0)
    assert opened.js("cospeechPlayer.frame") == 30
    assert opened.page.locator("#words .current").count() == 0
    assert opened.page.locator("#labels em:visible").all_inner_texts() == ["stroke"]
    assert opened.page.locator("#labels b").all_inner_texts() == ["recorded", "generated"]
    assert opened.page.locator("#facts").inner_text().split() == ["seed", "1"]


def test_every_frame_time_shows_that_frame(opened):
    shown = opened.js(
        """async () => {
          const seen = [];
          for (let i = 0; i < 60; i++) {
            cospeechPlayer.seek(i / 15);
            await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
            seen.push(cospeechPlayer.frame);
          }
          return seen;
        }"""
    )
    assert shown == list(range(60))


def test_nothing_is_asked_of_the_network_and_nothing_complains(opened, page_path):
    opened.show(3.0)
    opened.page.keyboard.press("t")
    opened.page.keyboard.press("d")
    opened.page.select_option("#clip", "1")
    opened.wait("cospeechPlayer.tracks.length === 1")
    opened.refresh()
    assert opened.problems == []
    outside = [u for u in opened.requests if u != page_path.as_uri() and not u.startswith("blob:")]
    assert outside == []


def test_motion_follows_the_sound(opened):
    """What a refresh shows is the sound's time between the moments before and after it, on a
    machine of any speed."""
    opened.page.click("#play")
    opened.wait("cospeechPlayer.playing && cospeechPlayer.time > 0")
    samples = opened.js(
        """async () => {
          const seen = [], end = performance.now() + 60000;
          while (seen.length < 10 || seen.at(-1)[2] - seen[0][2] < 0.6) {
            if (!cospeechPlayer.playing || performance.now() > end) break;
            const before = cospeechPlayer.time;
            await new Promise(done => requestAnimationFrame(done));
            // after the page's own callback of this refresh
            await new Promise(done => setTimeout(done));
            const { shownTime, frame } = cospeechPlayer;
            seen.push([before, shownTime, cospeechPlayer.time, frame]);
          }
          return seen;
        }"""
    )
    before, shown, after, frame = np.array(samples).T
    assert after[-1] - after[0] >= 0.6
    assert (before <= shown).all()
    assert (shown <= after).all()
    np.testing.assert_array_equal(frame, np.floor(shown * FPS + 1e-3))
    opened.page.keyboard.press(" ")
    assert opened.js("cospeechPlayer.playing") is False


def test_scrub_bar_arrow_keys_and_words_move_the_sound(opened):
    bar = opened.page.locator("#scrub").bounding_box()
    y = bar["y"] + bar["height"] / 2
    opened.page.mouse.move(bar["x"] + 9, y)
    opened.page.mouse.down()
    opened.page.mouse.move(bar["x"] + bar["width"] / 2, y, steps=5)
    opened.page.mouse.up()
    assert opened.js("cospeechPlayer.time") == pytest.approx(2.0, abs=0.05)
    opened.show(2.0)
    opened.page.keyboard.press("ArrowRight")
    assert opened.js("cospeechPlayer.time") == pytest.approx(31 / FPS, abs=1e-5)
    opened.page.keyboard.press("ArrowLeft")
    opened.page.keyboard.press("ArrowLeft")
    assert opened.js("cospeechPlayer.time") == pytest.approx(29 / FPS, abs=1e-5)
    opened.page.click("#words span:has-text('three')")
    assert opened.js("cospeechPlayer.time") == pytest.approx(2.4, abs=1e-5)


def test_time_line_jumps_to_where_it_is_clicked(opened):
    line = opened.page.locator("#timeline").bounding_box()
    gutter = 84  # row names
    x = line["x"] + gutter + (line["width"] - gutter) * 0.25
    opened.page.mouse.click(x, line["y"] + 40)
    assert opened.js("cospeechPlayer.time") == pytest.approx(1.0, abs=0.02)


def test_orbiting_turns_both_figures(opened):
    opened.show(0.5)
    before = opened.pixels()
    box = opened.page.locator("#view").bounding_box()
    opened.page.mouse.move(box["x"] + 300, box["y"] + 150)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 300 + 392, box["y"] + 150, steps=6)  # 180 degrees
    opened.page.mouse.up()
    opened.refresh()
    after = opened.pixels()
    half = before.shape[1] // 2
    for left, right in ((0, half), (half, 2 * half)):
        one, other = before[:, left:right], after[:, left:right]
        sides = [
            np.nonzero(orange(p))[1].mean() - np.nonzero(blue(p))[1].mean() for p in (one, other)
        ]
        assert sides[0] > 30
        assert sides[1] < -30
    # both show the same pose (at 0.5 s), so the same picture under the labels
    labels_end = 40
    difference = np.abs(after[labels_end:, 2:half] - after[labels_end:, half + 2 : 2 * half])
    assert (difference.max(axis=-1) > 30).mean() < 0.01


def test_decoded_sound_is_where_it_was(opened):
    click = opened.js(
        """async () => {
          const data = JSON.parse(document.getElementById('cospeech-data').textContent);
          const bytes = Uint8Array.from(atob(data.clips[0].audio.data), c => c.charCodeAt(0));
          const context = new OfflineAudioContext(1, 1, 16000);
          const samples = (await context.decodeAudioData(bytes.buffer)).getChannelData(0);
          let at = 0;
          samples.forEach((s, i) => { if (Math.abs(s) > Math.abs(samples[at])) at = i; });
          return [samples.length, at];
        }"""
    )
    assert click[0] == 4 * SAMPLE_RATE
    assert 0 <= click[1] - CLICK_AT_S * SAMPLE_RATE < 100
