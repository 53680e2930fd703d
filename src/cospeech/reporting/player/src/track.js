// One skeleton's motion: frames, poses between frames, wrist speeds, the path the camera follows.
import { decodePositions } from "./decode.js";

// an audio clock rounds to microseconds: i / fps must still fall into frame i
const FRAME_TOLERANCE = 1e-3;

export class Track {
  constructor(values) {
    Object.assign(this, values);
    this.data = null;
    this.positions = decodePositions(values);
    this.points = this.joints + (this.skull ? 1 : 0);
    this.pose = new Float32Array(this.points * 3);
    this.speeds = Object.fromEntries(
      Object.entries(this.wrists).map(([side, joint]) => [side, this.#speed(joint)]),
    );
    this.#measure();
  }

  /** Index of the frame on show at time t (seconds). */
  frameAt(t) {
    const frame = Math.floor(t * this.fps + FRAME_TOLERANCE);
    return Math.max(0, Math.min(this.frames - 1, frame));
  }

  /**
   * Points at time t, in `out`: the joints, then the centre of the skull where there is one.
   * The frame's own, or a blend with the next one.
   */
  poseAt(t, blend, out = this.pose) {
    const frame = this.frameAt(t);
    const size = this.joints * 3;
    const here = frame * size;
    const next = Math.min(frame + 1, this.frames - 1) * size;
    const w = blend ? Math.max(0, Math.min(1, t * this.fps - frame)) : 0;
    for (let i = 0; i < size; i++) {
      out[i] = this.positions[here + i] * (1 - w) + this.positions[next + i] * w;
    }
    if (this.skull) {
      const [below, above, place] = this.skull;
      for (let k = 0; k < 3; k++) {
        out[size + k] = out[3 * below + k] * (1 - place) + out[3 * above + k] * place;
      }
    }
    return out;
  }

  /** Where the camera looks at time t: a slow average of the root's place on the ground. */
  centreAt(t) {
    const i = 2 * this.frameAt(t);
    return [this.path[i], this.middle, this.path[i + 1]];
  }

  // speed against the root, so that a walk does not count as a gesture; m/s, central difference
  #speed(joint) {
    const p = this.positions;
    const size = this.joints * 3;
    const speed = new Float32Array(this.frames);
    for (let f = 0; f < this.frames; f++) {
      const a = Math.max(0, f - 1);
      const b = Math.min(this.frames - 1, f + 1);
      let sum = 0;
      for (let k = 0; k < 3; k++) {
        const d =
          p[b * size + joint * 3 + k] - p[b * size + k] -
          (p[a * size + joint * 3 + k] - p[a * size + k]);
        sum += d * d;
      }
      speed[f] = b > a ? (Math.sqrt(sum) * this.fps) / (b - a) : 0;
    }
    return speed;
  }

  #measure() {
    const size = this.joints * 3;
    const sums = new Float64Array(2 * (this.frames + 1));
    let reach = 0;
    for (let f = 0; f < this.frames; f++) {
      sums[2 * f + 2] = sums[2 * f] + this.positions[f * size];
      sums[2 * f + 3] = sums[2 * f + 1] + this.positions[f * size + 2];
    }
    // two seconds either side: turns and steps stay visible, travel does not leave the picture
    const half = Math.round(2 * this.fps);
    this.path = new Float32Array(2 * this.frames);
    for (let f = 0; f < this.frames; f++) {
      const a = Math.max(0, f - half);
      const b = Math.min(this.frames, f + half + 1);
      for (let k = 0; k < 2; k++) {
        this.path[2 * f + k] = (sums[2 * b + k] - sums[2 * a + k]) / (b - a);
      }
      for (let j = 0; j < this.joints; j++) {
        const i = f * size + 3 * j;
        reach = Math.max(
          reach,
          Math.hypot(this.positions[i] - this.path[2 * f], this.positions[i + 2] - this.path[2 * f + 1]),
        );
      }
    }
    this.middle = this.floor + this.height * 0.52;
    this.reach = reach;
  }
}
