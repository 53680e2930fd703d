// The strip under the picture: waveform, words, phases and wrist speeds on one time axis.

const GUTTER = 84;
const RULER = 18;
const WAVE = 42;
const WORDS = 22;
const PHASES = 16;
const SPEED = 40;
const GAP = 6;
const PAGE_SECONDS = 8;
const NARROWEST_TEXT = 0.72;

export class Timeline {
  constructor(canvas, { seek, changed, partColours, phaseColours }) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.partColours = partColours;
    this.phaseColours = phaseColours;
    this.changed = changed;
    this.seek = seek;
    this.#listen();
  }

  setClip(clip, tracks, samples) {
    Object.assign(this, { clip, tracks, duration: clip.duration });
    this.peaks = peaksOf(samples, clip.audio ? clip.audio.rate : 1);
    this.start = 0;
    this.span = Math.min(this.duration, PAGE_SECONDS);
    this.rows = [];
    let y = RULER;
    const add = (kind, height, rest = {}) => {
      this.rows.push({ kind, y, height, ...rest });
      y += height + GAP;
    };
    if (clip.audio) add("wave", WAVE);
    if (clip.words) add("words", WORDS);
    const fastest = Math.max(
      0.5, ...tracks.flatMap((track) => Object.values(track.speeds).map((v) => percentile(v, 0.995))),
    );
    this.fastest = Math.ceil(fastest * 2) / 2;
    for (const track of tracks) {
      if (track.phases) add("phases", PHASES, { track });
      if (Object.keys(track.speeds).length) add("speed", SPEED, { track });
    }
    this.height = y;
    this.canvas.style.height = `${this.height}px`;
  }

  resize(width, pixelRatio) {
    this.width = width;
    this.pixelRatio = pixelRatio;
    this.canvas.width = Math.round(width * pixelRatio);
    this.canvas.height = Math.round(this.height * pixelRatio);
  }

  /** Turn the page when the playhead leaves the part on show. */
  follow(t) {
    if (this.dragging) return;
    if (t < this.start || t > this.start + this.span * 0.96) this.#scroll(t - this.span * 0.06);
  }

  x(t) {
    return GUTTER + ((t - this.start) / this.span) * (this.width - GUTTER);
  }

  time(x) {
    return this.start + ((x - GUTTER) / (this.width - GUTTER)) * this.span;
  }

  draw(t, theme) {
    const { context: c } = this;
    c.setTransform(this.pixelRatio, 0, 0, this.pixelRatio, 0, 0);
    c.clearRect(0, 0, this.width, this.height);
    this.theme = theme;
    c.save();
    c.beginPath();
    c.rect(GUTTER, 0, this.width - GUTTER, this.height);
    c.clip();
    this.#ruler();
    for (const row of this.rows) this[`_${row.kind}`](row, t);
    c.restore();
    this.#names();
    this.#playhead(t);
  }

  #scroll(start) {
    this.start = Math.max(0, Math.min(this.duration - this.span, start));
    this.changed();
  }

  #ruler() {
    const { context: c, theme } = this;
    const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60, 300];
    const step = steps.find((s) => (s / this.span) * (this.width - GUTTER) > 70) ?? 600;
    c.font = "11px system-ui, sans-serif";
    c.textBaseline = "middle";
    for (let i = Math.floor(this.start / step); i * step <= this.start + this.span; i++) {
      const x = this.x(i * step);
      c.fillStyle = theme.line;
      c.fillRect(x, 0, 1, this.height);
      c.fillStyle = theme.muted;
      c.fillText(`${(i * step).toFixed(step < 1 ? 1 : 0)} s`, x + 4, RULER / 2);
    }
  }

  _wave({ y, height }) {
    const { context: c, theme, peaks } = this;
    c.fillStyle = theme.wave;
    const middle = y + height / 2;
    for (let x = GUTTER; x < this.width; x++) {
      const a = Math.floor(this.time(x) * peaks.rate);
      const b = Math.max(a + 1, Math.floor(this.time(x + 1) * peaks.rate));
      let peak = 0;
      for (let i = a; i < b && i < peaks.values.length; i++) peak = Math.max(peak, peaks.values[i]);
      const half = Math.max(0.5, (peak * height) / 2);
      c.fillRect(x, middle - half, 1, 2 * half);
    }
  }

  _words({ y, height }, t) {
    const { context: c, theme } = this;
    c.font = "12.5px system-ui, sans-serif";
    for (const [text, start, end] of this.clip.words) {
      if (end < this.start || start > this.start + this.span) continue;
      const x = this.x(start);
      const width = Math.max(2, this.x(end) - x - 1);
      const current = start <= t + 1e-6 && t + 1e-6 < end;
      c.fillStyle = current ? theme.accent : theme.chip;
      c.beginPath();
      c.roundRect(x, y, width, height, 4);
      c.fill();
      if (width < 12) continue;
      c.save();
      c.clip();
      c.fillStyle = current ? theme.onAccent : theme.text;
      const room = width - 5;
      const natural = c.measureText(text).width;
      const label = natural * NARROWEST_TEXT > room ? fit(c, text, room) : text;
      const used = Math.min(c.measureText(label).width, room);
      c.fillText(label, x + (width - used) / 2, y + height / 2 + 0.5, room);
      c.restore();
    }
  }

  _phases({ y, height, track }) {
    const { context: c } = this;
    c.font = "11px system-ui, sans-serif";
    for (const [start, end, label] of track.phases) {
      if (end < this.start || start > this.start + this.span) continue;
      const x = this.x(start);
      const width = Math.max(1, this.x(end) - x - 1);
      c.fillStyle = this.phaseColours[label] ?? this.theme.muted;
      c.globalAlpha = label === "none" ? 0.18 : 0.95;
      c.fillRect(x, y, width, height);
      c.globalAlpha = 1;
      if (label !== "none" && width > c.measureText(label).width + 8) {
        c.fillStyle = "#10151c";
        c.fillText(label.replaceAll("_", " "), x + 4, y + height / 2 + 0.5);
      }
    }
  }

  _speed({ y, height, track }) {
    const { context: c, theme } = this;
    c.fillStyle = theme.line;
    c.fillRect(GUTTER, y + height - 1, this.width - GUTTER, 1);
    for (const [side, speeds] of Object.entries(track.speeds)) {
      const colour = this.partColours[side === "left" ? 1 : 2];
      const first = Math.max(0, track.frameAt(this.start) - 1);
      const last = Math.min(track.frames - 1, track.frameAt(this.start + this.span) + 1);
      c.beginPath();
      for (let f = first; f <= last; f++) {
        const level = Math.min(1, speeds[f] / this.fastest);
        c.lineTo(this.x(f / track.fps), y + height - 1 - level * (height - 3));
      }
      c.strokeStyle = colour;
      c.lineWidth = 1.6;
      c.lineJoin = "round";
      c.stroke();
      c.lineTo(this.x(last / track.fps), y + height - 1);
      c.lineTo(this.x(first / track.fps), y + height - 1);
      c.fillStyle = colour;
      c.globalAlpha = 0.12;
      c.fill();
      c.globalAlpha = 1;
    }
  }

  #names() {
    const { context: c, theme } = this;
    c.textAlign = "right";
    c.textBaseline = "middle";
    for (const { kind, y, height, track } of this.rows) {
      const middle = y + height / 2;
      const right = GUTTER - 10;
      c.font = "11.5px system-ui, sans-serif";
      c.fillStyle = theme.muted;
      if (kind === "speed") {
        c.fillStyle = theme.text;
        c.fillText(fit(c, track.name, GUTTER - 14), right, middle - 7);
        c.fillStyle = theme.muted;
        c.font = "10px system-ui, sans-serif";
        c.fillText(`0\u2013${this.fastest} m/s`, right, middle + 7);
      } else {
        c.fillText({ wave: "speech", words: "words", phases: "phases" }[kind], right, middle);
      }
    }
    c.textAlign = "left";
  }

  #playhead(t) {
    const { context: c, theme } = this;
    const x = this.x(t);
    if (x < GUTTER - 1) return;
    c.fillStyle = theme.accent;
    c.fillRect(x - 0.75, 0, 1.5, this.height);
    c.beginPath();
    c.moveTo(x - 6, 0);
    c.lineTo(x + 6, 0);
    c.lineTo(x, 8);
    c.fill();
  }

  #listen() {
    const { canvas } = this;
    const scrub = (event) => {
      const x = Math.max(GUTTER, event.clientX - canvas.getBoundingClientRect().left);
      this.seek(this.time(x));
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.dragging = true;
      scrub(event);
    });
    canvas.addEventListener("pointermove", (event) => this.dragging && scrub(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, () => (this.dragging = false));
    }
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
          this.#scroll(this.start + ((event.deltaX || event.deltaY) / this.width) * this.span);
          return;
        }
        const under = this.time(Math.max(GUTTER, event.offsetX));
        const span = Math.max(0.5, Math.min(this.duration, this.span * Math.exp(event.deltaY * 0.0015)));
        const start = under - ((under - this.start) * span) / this.span;
        this.span = span;
        this.#scroll(start);
      },
      { passive: false },
    );
  }
}

// loudest sample of each 5 ms, scaled to the loudest of the clip
function peaksOf(samples, rate) {
  const step = Math.max(1, Math.round(rate / 200));
  const values = new Float32Array(Math.ceil(samples.length / step));
  let loudest = 1e-4;
  samples.forEach((sample, i) => {
    const at = Math.floor(i / step);
    values[at] = Math.max(values[at], Math.abs(sample));
    loudest = Math.max(loudest, Math.abs(sample));
  });
  return { values: values.map((v) => v / loudest), rate: rate / step };
}

function percentile(values, q) {
  const sorted = Float32Array.from(values).sort();
  return sorted[Math.floor(q * (sorted.length - 1))];
}

function fit(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let end = text.length;
  while (end > 1 && context.measureText(`${text.slice(0, end)}\u2026`).width > width) end--;
  return `${text.slice(0, end)}\u2026`;
}
