// Cospeech player: reads the page's data, wires the parts together, draws when time moves.
import { OrbitCamera, FIELD_OF_VIEW } from "./camera.js";
import { Clock } from "./clock.js";
import { buildPage, element, fillFacts, fillLegend, fillWords, icon } from "./page.js";
import { Stage } from "./stage.js";
import { Stage2d } from "./stage2d.js";
import { Timeline } from "./timeline.js";
import { Track } from "./track.js";

const data = JSON.parse(document.getElementById("cospeech-data").textContent);
const ui = buildPage(data);
const shown = { time: -1, word: -1 };
const options = { blend: true, trails: true };
let clip = data.clips[0];
let tracks = [];
let wordSpans = [];
let cells = [];
let dirty = true;
let theme = null;
const redraw = () => (dirty = true);

function fail(message) {
  ui.message.textContent = message;
  ui.message.hidden = false;
}

// WebGL in software takes 100 ms and more a picture, the plain canvas two.
function hasGraphicsHardware() {
  const context = document.createElement("canvas")
    .getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!context) return false;
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const renderer = context.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

function makeStage() {
  const canvas = element("canvas", { id: "view" });
  ui.stage.prepend(canvas);
  return new (hasGraphicsHardware() ? Stage : Stage2d)(canvas, data.partColours);
}

const stage = makeStage();
const clock = new Clock(() => {
  ui.play.replaceChildren(icon(clock.playing ? "pause" : "play"));
  redraw();
});
const orbit = new OrbitCamera(ui.stage, redraw);
const timeline = new Timeline(ui.timeline, {
  seek,
  changed: redraw,
  partColours: data.partColours,
  phaseColours: data.phaseColours,
});

function seek(t) {
  clock.seek(t);
  redraw();
}

async function play() {
  try {
    await clock.play();
  } catch (error) {
    if (error.name !== "AbortError") fail(`The browser does not play the sound: ${error.message}`);
  }
}

function toggle() {
  if (clock.playing) clock.pause();
  else play();
}

function stepFrame(direction) {
  const fastest = tracks.reduce((a, b) => (b.fps > a.fps ? b : a));
  clock.pause();
  seek((fastest.frameAt(clock.time) + direction) / fastest.fps);
}

async function showClip(index) {
  clip = data.clips[index];
  ui.clip.value = String(index);
  tracks = clip.tracks.map((values) => new Track(values));
  ui.labels.replaceChildren(...tracks.map((track) =>
    element("div", {}, element("b", { textContent: track.name }), element("small", {}), element("em", {}))));
  fillFacts(ui.facts, clip.facts);
  fillLegend(ui.legend, tracks, data.partColours, data.phaseColours);
  wordSpans = fillWords(ui.words, clip.words, seek);
  shown.word = -1;
  ui.scrub.max = String(clip.duration);
  stage.setTracks(tracks);
  let samples = new Float32Array(0);
  try {
    samples = await clock.load(clip);
  } catch (error) {
    fail(`The sound of this clip can't be decoded here, it plays silently: ${error.message}`);
    await clock.load({ duration: clip.duration });
  }
  timeline.setClip(clip, tracks, samples);
  layout();
  frameAll();
  seek(0);
}

// how far away the camera must be for every figure to fit its cell
function frameAll() {
  const half = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const aspect = cells[0].width / cells[0].height;
  orbit.home(Math.max(...tracks.map((track) =>
    Math.max((0.54 * track.height) / half, (0.9 * track.reach) / (half * aspect)) + 0.5 * track.reach)));
}

function layout() {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const { clientWidth: width, clientHeight: height } = ui.stage;
  const columns = tracks.length <= 4 ? tracks.length : Math.ceil(tracks.length / 2);
  const rows = Math.ceil(tracks.length / columns);
  cells = tracks.map((_, i) => ({
    x: ((i % columns) * width) / columns,
    y: (Math.floor(i / columns) * height) / rows,
    width: width / columns,
    height: height / rows,
  }));
  stage.resize(width, height, ratio);
  [...ui.labels.children].forEach((label, i) => {
    label.style.left = `${cells[i].x}px`;
    label.style.top = `${cells[i].y}px`;
    label.style.width = `${cells[i].width}px`;
    label.style.height = `${cells[i].height}px`;
  });
  if (timeline.clip) timeline.resize(ui.timeline.clientWidth, ratio);
  redraw();
}

function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const value = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    background: value("stage"), grid: value("grid"), text: value("text"), muted: value("muted"),
    line: value("line"), chip: value("chip"), accent: value("accent"), onAccent: value("on-accent"),
    wave: value("wave"), dark: document.documentElement.dataset.theme === "dark",
  };
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  theme = readTheme();
  stage.setTheme(theme);
  redraw();
}

function showWord(t) {
  let current = -1;
  (clip.words ?? []).forEach(([, start, end], i) => {
    if (start <= t + 1e-6 && t + 1e-6 < end) current = i;
  });
  if (current === shown.word) return;
  wordSpans[shown.word]?.classList.remove("current");
  const span = wordSpans[current];
  if (span) {
    span.classList.add("current");
    const { offsetTop } = span;
    if (offsetTop < ui.words.scrollTop || offsetTop + span.offsetHeight > ui.words.scrollTop + ui.words.clientHeight) {
      ui.words.scrollTop = offsetTop - 6;
    }
  }
  shown.word = current;
}

function showLabels(t) {
  tracks.forEach((track, i) => {
    const [, frame, phase] = ui.labels.children[i].children;
    frame.textContent = `frame ${track.frameAt(t)} / ${track.frames - 1} \u00b7 ${+track.fps.toFixed(2)} fps`;
    const run = track.phases?.find(([start, end]) => start <= t + 1e-6 && t + 1e-6 < end);
    phase.hidden = !run || run[2] === "none";
    if (run) {
      phase.textContent = run[2].replaceAll("_", " ");
      phase.style.background = data.phaseColours[run[2]] ?? "";
    }
  });
}

function draw(t) {
  timeline.follow(t);
  stage.draw(t, { ...options, orbit, cells });
  timeline.draw(t, theme);
  showWord(t);
  showLabels(t);
  ui.scrub.value = String(t);
  ui.scrub.style.setProperty("--done", `${(100 * t) / clip.duration}%`);
  ui.time.textContent = `${t.toFixed(2)} / ${clip.duration.toFixed(2)} s`;
  shown.time = t;
}

function tick() {
  const t = clock.time;
  if (timeline.clip === clip && (dirty || t !== shown.time)) {
    dirty = false;
    draw(t);
  }
  requestAnimationFrame(tick);
}

function press(button, on) {
  button.setAttribute("aria-pressed", String(on));
  redraw();
}

function switchOption(name) {
  options[name] = !options[name];
  press(ui[name], options[name]);
}

function switchLoop() {
  clock.audio.loop = !clock.audio.loop;
  press(ui.loop, clock.audio.loop);
}

function switchTheme() {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
}

function changeClip(step) {
  const next = data.clips.indexOf(clip) + step;
  if (next >= 0 && next < data.clips.length) showClip(next);
}

const KEYS = {
  " ": toggle,
  ArrowLeft: (event) => (event.shiftKey ? seek(clock.time - 1) : stepFrame(-1)),
  ArrowRight: (event) => (event.shiftKey ? seek(clock.time + 1) : stepFrame(1)),
  Home: () => seek(0),
  End: () => seek(clip.duration),
  PageUp: () => changeClip(-1),
  PageDown: () => changeClip(1),
  l: switchLoop,
  i: () => switchOption("blend"),
  t: () => switchOption("trails"),
  d: switchTheme,
};

window.addEventListener("keydown", (event) => {
  const typing = event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey;
  const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (typing || !action) return;
  event.preventDefault();
  action(event);
});
ui.play.addEventListener("click", toggle);
ui.scrub.addEventListener("input", () => seek(Number(ui.scrub.value)));
ui.rate.addEventListener("change", () => (clock.audio.playbackRate = Number(ui.rate.value)));
ui.loop.addEventListener("click", switchLoop);
ui.blend.addEventListener("click", () => switchOption("blend"));
ui.trails.addEventListener("click", () => switchOption("trails"));
ui.theme.addEventListener("click", switchTheme);
ui.clip.addEventListener("change", () => showClip(Number(ui.clip.value)));
new ResizeObserver(layout).observe(ui.stage);

press(ui.blend, options.blend);
press(ui.trails, options.trails);
press(ui.loop, false);
setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
const ready = showClip(0).then(() => new Promise((resolve) => {
  requestAnimationFrame(() => requestAnimationFrame(resolve));
}));
requestAnimationFrame(tick);

window.cospeechPlayer = {
  ready,
  play,
  seek,
  pause: () => clock.pause(),
  /** Seconds, from the sound. */
  get time() {
    return clock.time;
  },
  /** Seconds that the picture shows; behind `time` by at most one screen refresh. */
  get shownTime() {
    return shown.time;
  },
  /** Frame of the first track that the picture shows. */
  get frame() {
    return tracks[0].frameAt(shown.time);
  },
  get playing() {
    return clock.playing;
  },
  get tracks() {
    return tracks;
  },
};
