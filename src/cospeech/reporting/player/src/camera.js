// One orbiting camera, shared by every skeleton: azimuth 0 looks a person in the face.

const HOME = { azimuth: 0.42, elevation: 0.12 };
export const FIELD_OF_VIEW = 30; // degrees, vertical

export class OrbitCamera {
  constructor(element, changed) {
    this.changed = changed;
    this.home(2);
    this.#listen(element);
  }

  /** Back to three-quarter view at a distance (metres) that shows the whole figure. */
  home(distance) {
    this.homeDistance = distance;
    Object.assign(this, HOME, { distance, pan: [0, 0] });
    this.changed();
  }

  /** Eye and target, given what is looked at and which way that person faces (radians about y). */
  place(centre, yaw) {
    const a = this.azimuth + yaw;
    const level = Math.cos(this.elevation);
    const right = [Math.cos(a), 0, -Math.sin(a)];
    const rise = Math.sin(this.elevation);
    const up = [-Math.sin(a) * rise, level, -Math.cos(a) * rise];
    const target = centre.map((c, k) => c + right[k] * this.pan[0] + up[k] * this.pan[1]);
    const back = [Math.sin(a) * level, rise, Math.cos(a) * level];
    return { target, eye: target.map((c, k) => c + back[k] * this.distance), right, up, back };
  }

  #zoom(factor) {
    this.distance = Math.max(0.25, Math.min(25, this.distance * factor));
    this.changed();
  }

  #listen(element) {
    const fingers = new Map();
    let spread = 0;
    const between = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a.x - b.x, a.y - b.y);
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (fingers.size === 2) spread = between();
    });
    element.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const dx = event.clientX - last.x;
      const dy = event.clientY - last.y;
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (fingers.size === 2) {
        const now = between();
        this.#zoom(spread / now);
        spread = now;
      } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) {
        const metres = (2 * this.distance * Math.tan((FIELD_OF_VIEW * Math.PI) / 360)) / element.clientHeight;
        this.pan = [this.pan[0] - dx * metres, this.pan[1] + dy * metres];
        this.changed();
      } else {
        this.azimuth -= dx * 0.008;
        this.elevation = Math.max(-0.25, Math.min(1.5, this.elevation + dy * 0.008));
        this.changed();
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      element.addEventListener(name, (event) => fingers.delete(event.pointerId));
    }
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("dblclick", () => this.home(this.homeDistance));
    element.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.#zoom(Math.exp(event.deltaY * 0.0012));
      },
      { passive: false },
    );
  }
}
