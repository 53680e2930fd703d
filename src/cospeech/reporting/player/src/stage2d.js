// The picture without graphics hardware: shaded capsules on a 2-D canvas, far ones first.
import { FIELD_OF_VIEW } from "./camera.js";

const INK = [20, 26, 40];
const WHITE = [255, 255, 255];
const TAPER = 0.84;
const LIGHT = [0.44, 0.75]; // how far a shadow falls to the right and behind, per metre of height
const GRID_STEP = 0.25; // metres
const GRID_REACH = 2.0;
const GRID_SEGMENTS = 24;
const GRID_SHADES = 6;
const TRAIL_SECONDS = 0.5;
const TRAIL_POINTS = 16;

function rgb(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

function mix(colour, other, share) {
  return colour.map((value, k) => Math.round(value + (other[k] - value) * share));
}

function css(colour) {
  return `rgb(${colour.join(" ")})`;
}

export class Stage2d {
  constructor(canvas, colours) {
    this.context = canvas.getContext("2d");
    this.colours = colours.map(rgb);
    this.tracks = [];
  }

  setTracks(tracks) {
    this.tracks = tracks;
  }

  setTheme(theme) {
    this.background = rgb(theme.background);
    this.grid = rgb(theme.grid);
    this.shadow = mix(this.background, INK, theme.dark ? 0.55 : 0.12);
  }

  resize(width, height, pixelRatio) {
    const { canvas } = this.context;
    canvas.width = Math.round(width * pixelRatio);
    canvas.height = Math.round(height * pixelRatio);
    this.pixelRatio = pixelRatio;
  }

  /** Draw every track at time t; cells are CSS-pixel rectangles from the canvas's top left. */
  draw(t, { blend, trails, orbit, cells }) {
    const { context: c } = this;
    c.setTransform(this.pixelRatio, 0, 0, this.pixelRatio, 0, 0);
    this.tracks.forEach((track, i) => {
      const cell = cells[i];
      c.save();
      c.beginPath();
      c.rect(cell.x, cell.y, cell.width, cell.height);
      c.clip();
      c.fillStyle = css(this.background);
      c.fill();
      const centre = track.centreAt(t);
      const project = projection(orbit.place(centre, track.yaw), cell);
      this.#drawGrid(project, centre, track.floor);
      this.#drawFigure(track, track.poseAt(t, blend), project, orbit.distance);
      if (trails) this.#drawTrails(track, t, project);
      c.restore();
    });
  }

  #drawFigure(track, pose, project, distance) {
    const place = (j) => [pose[3 * j], pose[3 * j + 1], pose[3 * j + 2]];
    const [sine, cosine] = [Math.sin(track.yaw), Math.cos(track.yaw)];
    const shade = (j) => {
      const [x, y, z] = place(j);
      const [right, back] = LIGHT.map((metres) => metres * (y - track.floor));
      return project([x - right * cosine - back * sine, track.floor, z + right * sine - back * cosine]);
    };
    const shadow = css(this.shadow);
    for (const [upper, lower, , radius] of track.limbs) {
      const [a, b] = [shade(upper), shade(lower)];
      // seen from this low, a disc on the ground is a flat ellipse: half the bone's width
      this.#capsule(a, b, 0.5 * radius * a.scale, 0.5 * radius * b.scale, shadow);
    }
    const skull = track.balls.find(([point]) => point === track.joints);
    const strokes = [];
    for (const [upper, lower, part, radius] of track.limbs) {
      let from = place(upper);
      const to = place(lower);
      if (skull && upper === track.joints) {
        // the nose: what of it is inside the skull would be painted over the face
        const share = (0.92 * skull[2]) / Math.hypot(...to.map((v, k) => v - from[k]));
        if (share >= 1) continue;
        from = from.map((v, k) => v + (to[k] - v) * share);
      }
      const [a, b] = [project(from), project(to)];
      strokes.push({ a, b, part, ra: radius * a.scale, rb: radius * TAPER * b.scale });
    }
    for (const [centre, part, radius] of track.balls) {
      const a = project(place(centre));
      strokes.push({ a, b: a, part, ra: radius * a.scale, rb: radius * a.scale });
    }
    strokes.sort((one, other) => other.a.depth + other.b.depth - one.a.depth - one.b.depth);
    for (const stroke of strokes) this.#bone(stroke, distance);
  }

  #bone({ a, b, part, ra, rb }, distance) {
    const fade = Math.min(0.4, Math.max(0, ((a.depth + b.depth) / 2 - distance) / 1.6 + 0.12));
    const colour = mix(this.colours[part], this.background, fade);
    this.#rim(a, b, ra + 1.5, rb + 1.5);
    this.#capsule(a, b, ra, rb, css(mix(colour, INK, 0.22)));
    const layer = (right, down, size, tint) => {
      const shift = (p, r) => ({ x: p.x - right * r, y: p.y - down * r });
      this.#capsule(shift(a, ra), shift(b, rb), size * ra, size * rb, css(tint));
    };
    layer(0.14, 0.18, 0.78, colour);
    if (ra > 2.5) layer(0.32, 0.36, 0.26, mix(colour, WHITE, 0.28));
  }

  #drawTrails(track, t, project) {
    const { context: c } = this;
    const pose = new Float32Array(track.points * 3);
    c.lineCap = "round";
    for (const [side, joint] of Object.entries(track.wrists)) {
      let last = null;
      for (let i = 0; i < TRAIL_POINTS; i++) {
        const age = i / (TRAIL_POINTS - 1);
        track.poseAt(Math.max(0, t - TRAIL_SECONDS * age), true, pose);
        const here = project([pose[3 * joint], pose[3 * joint + 1], pose[3 * joint + 2]]);
        if (last && Math.hypot(here.x - last.x, here.y - last.y) > 0.3) {
          c.strokeStyle = css(this.colours[side === "left" ? 1 : 2]);
          c.globalAlpha = 0.4 * (1 - age);
          c.lineWidth = 0.035 * here.scale * (1 - 0.8 * age);
          c.beginPath();
          c.moveTo(last.x, last.y);
          c.lineTo(here.x, here.y);
          c.stroke();
        }
        last = here;
      }
    }
    c.globalAlpha = 1;
  }

  #drawGrid(project, centre, floor) {
    const shades = Array.from({ length: GRID_SHADES }, () => new Path2D());
    const near = [centre[0], centre[2]].map((v) => Math.round(v / GRID_STEP) * GRID_STEP);
    const count = Math.round(GRID_REACH / GRID_STEP);
    for (const axis of [0, 1]) {
      for (let i = -count; i <= count; i++) {
        let last = null;
        for (let k = 0; k <= GRID_SEGMENTS; k++) {
          const along = GRID_REACH * ((2 * k) / GRID_SEGMENTS - 1);
          const across = near[axis] + i * GRID_STEP;
          const x = axis ? centre[0] + along : across;
          const z = axis ? across : centre[2] + along;
          const here = project([x, floor, z]);
          const strength = 1 - Math.hypot(x - centre[0], z - centre[2]) / GRID_REACH;
          if (last && strength > 0) {
            const shade = shades[Math.min(GRID_SHADES - 1, Math.floor(strength * GRID_SHADES))];
            shade.moveTo(last.x, last.y);
            shade.lineTo(here.x, here.y);
          }
          last = here;
        }
      }
    }
    this.context.lineWidth = 1;
    this.context.lineCap = "butt";
    shades.forEach((path, i) => {
      this.context.strokeStyle = css(mix(this.background, this.grid, (0.75 * (i + 0.5)) / GRID_SHADES));
      this.context.stroke(path);
    });
  }

  #capsule(a, b, ra, rb, colour) {
    const { context: c } = this;
    c.fillStyle = colour;
    if (this.#sides(a, b, ra, rb, 0)) c.fill();
    for (const [p, r] of [[a, ra], [b, rb]]) {
      c.beginPath();
      c.arc(p.x, p.y, r, 0, 2 * Math.PI);
      c.fill();
    }
  }

  // Background along a bone's sides keeps crossing bones apart. It stops short of the joints, where
  // it would cut the next bone of the chain.
  #rim(a, b, ra, rb) {
    this.context.fillStyle = css(this.background);
    if (this.#sides(a, b, ra, rb, Math.max(ra, rb))) this.context.fill();
  }

  #sides(a, b, ra, rb, inset) {
    const length = Math.hypot(b.x - a.x, b.y - a.y);
    if (length <= 2 * inset + 1e-6) return false;
    const [x, y] = [(b.x - a.x) / length, (b.y - a.y) / length];
    const { context: c } = this;
    c.beginPath();
    c.moveTo(a.x + x * inset - y * ra, a.y + y * inset + x * ra);
    c.lineTo(b.x - x * inset - y * rb, b.y - y * inset + x * rb);
    c.lineTo(b.x - x * inset + y * rb, b.y - y * inset - x * rb);
    c.lineTo(a.x + x * inset + y * ra, a.y + y * inset - x * ra);
    c.closePath();
    return true;
  }
}

// metres to CSS pixels in a cell, with pixels per metre at that depth
function projection(view, cell) {
  const focal = cell.height / 2 / Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const [ex, ey, ez] = view.eye;
  const dot = (axis, p) => axis[0] * (p[0] - ex) + axis[1] * (p[1] - ey) + axis[2] * (p[2] - ez);
  return (p) => {
    const depth = Math.max(0.05, -dot(view.back, p));
    const scale = focal / depth;
    return {
      x: cell.x + cell.width / 2 + dot(view.right, p) * scale,
      y: cell.y + cell.height / 2 - dot(view.up, p) * scale,
      depth,
      scale,
    };
  };
}
