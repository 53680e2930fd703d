// The same picture without WebGL: bones as round strokes on a 2-D canvas, far ones first.
import { FIELD_OF_VIEW } from "./camera.js";

export class Stage2d {
  constructor(canvas, colours) {
    this.context = canvas.getContext("2d");
    this.colours = colours;
    this.tracks = [];
  }

  setTracks(tracks) {
    this.tracks = tracks;
  }

  setTheme(theme) {
    this.theme = theme;
  }

  resize(width, height, pixelRatio) {
    const { canvas } = this.context;
    canvas.width = Math.round(width * pixelRatio);
    canvas.height = Math.round(height * pixelRatio);
    this.pixelRatio = pixelRatio;
  }

  draw(t, { blend, orbit, cells }) {
    const { context: c } = this;
    c.setTransform(this.pixelRatio, 0, 0, this.pixelRatio, 0, 0);
    c.fillStyle = this.theme.background;
    c.fillRect(0, 0, c.canvas.width, c.canvas.height);
    this.tracks.forEach((track, i) => this.#drawTrack(track, t, blend, orbit, cells[i]));
  }

  #drawTrack(track, t, blend, orbit, cell) {
    const { context: c } = this;
    const centre = track.centreAt(t);
    const view = orbit.place(centre, track.yaw);
    const focal = cell.height / 2 / Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    const dot = (p, axis) => axis.reduce((sum, a, k) => sum + a * (p[k] - view.eye[k]), 0);
    const project = (p) => {
      const depth = Math.max(0.05, -dot(p, view.back));
      return {
        x: cell.x + cell.width / 2 + (focal * dot(p, view.right)) / depth,
        y: cell.y + cell.height / 2 - (focal * dot(p, view.up)) / depth,
        depth,
      };
    };
    c.save();
    c.beginPath();
    c.rect(cell.x, cell.y, cell.width, cell.height);
    c.clip();
    this.#grid(project, centre, track.floor);
    const pose = track.poseAt(t, blend);
    const point = (j) => project([pose[3 * j], pose[3 * j + 1], pose[3 * j + 2]]);
    const strokes = track.limbs.map(([upper, lower, part, radius]) => {
      const [a, b] = [point(upper), point(lower)];
      return { a, b, part, width: (2 * radius * focal) / ((a.depth + b.depth) / 2) };
    });
    for (const [centre, part, radius] of track.balls) {
      const a = point(centre);
      strokes.push({ a, b: a, part, width: (2 * radius * focal) / a.depth });
    }
    strokes
      .sort((one, other) => other.a.depth + other.b.depth - one.a.depth - one.b.depth)
      .forEach(({ a, b, part, width }) => {
        // a rim in the background's colour, along the sides only, keeps crossing bones apart
        this.context.lineCap = "butt";
        this.#line(a, b, this.theme.background, width + 2);
        this.context.lineCap = "round";
        this.#line(a, b, this.colours[part], width);
      });
    c.restore();
  }

  #grid(project, centre, floor) {
    const reach = 1.5;
    this.context.globalAlpha = 0.35;
    for (let i = -6; i <= 6; i++) {
      const x = Math.round(centre[0] / 0.25) * 0.25 + i * 0.25;
      const z = Math.round(centre[2] / 0.25) * 0.25 + i * 0.25;
      this.#line(project([x, floor, centre[2] - reach]), project([x, floor, centre[2] + reach]), this.theme.grid, 1);
      this.#line(project([centre[0] - reach, floor, z]), project([centre[0] + reach, floor, z]), this.theme.grid, 1);
    }
    this.context.globalAlpha = 1;
  }

  #line(a, b, colour, width) {
    const { context: c } = this;
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.beginPath();
    c.moveTo(a.x, a.y);
    // a stroke of no length is not drawn, not even its round ends
    c.lineTo(b.x + (a === b ? 0.01 : 0), b.y);
    c.stroke();
  }
}
