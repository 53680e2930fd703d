// Skeletons in WebGL: capsules with soft shadows on a fading grid, one viewport per track.
import {
  AmbientLight, BufferGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide,
  Float32BufferAttribute, HemisphereLight, InstancedMesh, Matrix4, Mesh, MeshStandardMaterial,
  PCFShadowMap, PerspectiveCamera, PlaneGeometry, Quaternion, Scene, ShaderMaterial, ShadowMaterial,
  SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { FIELD_OF_VIEW } from "./camera.js";

const TRAIL_SECONDS = 0.5;
const TRAIL_POINTS = 24;
const UP = new Vector3(0, 1, 0);

const GRID_VERTEX = `
varying vec3 world;
void main() {
  vec4 place = modelMatrix * vec4(position, 1.0);
  world = place.xyz;
  gl_Position = projectionMatrix * viewMatrix * place;
}`;
const GRID_FRAGMENT = `
uniform vec3 colour;
uniform vec2 centre;
varying vec3 world;
float lines(float metres) {
  vec2 at = world.xz / metres;
  vec2 width = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / width;
  return (1.0 - min(min(near.x, near.y), 1.0)) * smoothstep(1.0, 0.25, max(width.x, width.y));
}
void main() {
  float fade = 1.0 - smoothstep(0.4, 2.6, distance(world.xz, centre));
  float alpha = max(lines(0.25) * 0.35, lines(1.0) * 0.8) * fade * fade;
  if (alpha < 0.004) discard;
  gl_FragColor = vec4(colour, alpha);
}`;

class Figure {
  constructor(track, colours) {
    this.track = track;
    this.colours = colours;
    const count = track.limbs.length;
    const material = new MeshStandardMaterial({ roughness: 0.55, metalness: 0.0 });
    // the lower end is a little thinner than the upper one
    this.bones = new InstancedMesh(new CylinderGeometry(0.84, 1, 1, 20, 1, true), material, count);
    this.caps = new InstancedMesh(new SphereGeometry(1, 28, 20), material, 2 * count + track.balls.length);
    for (const mesh of [this.bones, this.caps]) {
      mesh.castShadow = true;
      mesh.receiveShadow = true;
      mesh.frustumCulled = false;
    }
    track.limbs.forEach(([, , part], i) => {
      const colour = new Color(colours[part]);
      this.bones.setColorAt(i, colour);
      this.caps.setColorAt(2 * i, colour);
      this.caps.setColorAt(2 * i + 1, colour);
    });
    track.balls.forEach(([, part], i) => this.caps.setColorAt(2 * count + i, new Color(colours[part])));
    this.trails = Object.entries(track.wrists).map(([side, joint]) => this.#trail(side, joint));
    this.parts = [this.bones, this.caps, ...this.trails.map((trail) => trail.mesh)];
    this.scratch = new Float32Array(track.points * 3);
  }

  // a ribbon of triangles whose width and opacity die away into the past
  #trail(side, joint) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(new Float32Array(TRAIL_POINTS * 6), 3));
    geometry.setAttribute("age", new Float32BufferAttribute(
      Float32Array.from({ length: TRAIL_POINTS * 2 }, (_, i) => (i >> 1) / (TRAIL_POINTS - 1)), 1));
    const index = [];
    for (let i = 0; i < TRAIL_POINTS - 1; i++) {
      index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2);
    }
    geometry.setIndex(index);
    const mesh = new Mesh(geometry, new ShaderMaterial({
      uniforms: { colour: { value: new Color(this.colours[side === "left" ? 1 : 2]).convertLinearToSRGB() } },
      vertexShader: `attribute float age; varying float old;
        void main() { old = age; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
      fragmentShader: `uniform vec3 colour; varying float old;
        void main() { gl_FragColor = vec4(colour, 0.5 * pow(1.0 - old, 1.5)); }`,
      transparent: true,
      depthWrite: false,
      side: DoubleSide,
    }));
    mesh.frustumCulled = false;
    return { mesh, joint };
  }

  update(t, blend, trails, eye) {
    const pose = this.track.poseAt(t, blend);
    const a = new Vector3();
    const b = new Vector3();
    const matrix = new Matrix4();
    const turn = new Quaternion();
    const none = new Quaternion();
    const scale = new Vector3();
    this.track.limbs.forEach(([upper, lower, , radius], i) => {
      a.fromArray(pose, 3 * upper);
      b.fromArray(pose, 3 * lower);
      matrix.compose(a, none, scale.setScalar(radius));
      this.caps.setMatrixAt(2 * i, matrix);
      matrix.compose(b, none, scale.setScalar(radius * 0.84));
      this.caps.setMatrixAt(2 * i + 1, matrix);
      const along = b.clone().sub(a);
      const length = along.length();
      turn.setFromUnitVectors(UP, along.divideScalar(length || 1));
      matrix.compose(a.add(b).multiplyScalar(0.5), turn, scale.set(radius, length, radius));
      this.bones.setMatrixAt(i, matrix);
    });
    this.track.balls.forEach(([point, , radius], i) => {
      matrix.compose(a.fromArray(pose, 3 * point), none, scale.setScalar(radius));
      this.caps.setMatrixAt(2 * this.track.limbs.length + i, matrix);
    });
    this.bones.instanceMatrix.needsUpdate = true;
    this.caps.instanceMatrix.needsUpdate = true;
    for (const trail of this.trails) {
      trail.mesh.visible = trails;
      if (trails) this.#updateTrail(trail, t, eye);
    }
  }

  #updateTrail({ mesh, joint }, t, eye) {
    const places = [];
    for (let i = 0; i < TRAIL_POINTS; i++) {
      const past = Math.max(0, t - (TRAIL_SECONDS * i) / (TRAIL_POINTS - 1));
      places.push(new Vector3().fromArray(this.track.poseAt(past, true, this.scratch), 3 * joint));
    }
    const attribute = mesh.geometry.attributes.position;
    const camera = new Vector3(...eye);
    places.forEach((place, i) => {
      const along = places[Math.max(0, i - 1)].clone().sub(places[Math.min(TRAIL_POINTS - 1, i + 1)]);
      const across = along.cross(camera.clone().sub(place)).normalize();
      across.multiplyScalar(0.02 * (1 - (0.9 * i) / TRAIL_POINTS));
      attribute.setXYZ(2 * i, ...place.clone().add(across).toArray());
      attribute.setXYZ(2 * i + 1, ...place.clone().sub(across).toArray());
    });
    attribute.needsUpdate = true;
  }

  dispose() {
    for (const part of this.parts) {
      part.geometry.dispose();
      part.material.dispose();
      part.dispose?.();
    }
  }
}

export class Stage {
  constructor(canvas, colours) {
    this.colours = colours;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.setScissorTest(true);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.05, 60);
    this.hemisphere = new HemisphereLight(0xffffff, 0x8890a0, 1.5);
    this.key = new DirectionalLight(0xffffff, 2.2);
    this.fill = new DirectionalLight(0xdfe8ff, 0.5);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(1024, 1024);
    Object.assign(this.key.shadow.camera, { left: -1.6, right: 1.6, top: 1.9, bottom: -1.6, near: 0.5, far: 9 });
    this.key.shadow.radius = 4;
    this.key.shadow.bias = -0.0006;
    this.key.shadow.normalBias = 0.006;
    this.ground = new Mesh(new PlaneGeometry(7, 7).rotateX(-Math.PI / 2), new ShadowMaterial({ opacity: 0.22 }));
    this.ground.receiveShadow = true;
    this.grid = new Mesh(
      new PlaneGeometry(7, 7).rotateX(-Math.PI / 2),
      new ShaderMaterial({
        vertexShader: GRID_VERTEX,
        fragmentShader: GRID_FRAGMENT,
        uniforms: { colour: { value: new Color() }, centre: { value: { x: 0, y: 0 } } },
        transparent: true,
        depthWrite: false,
      }),
    );
    this.scene.add(
      this.hemisphere, this.key, this.key.target, this.fill, this.fill.target, this.ground,
      this.grid, new AmbientLight(0xffffff, 0.25),
    );
    this.figures = [];
  }

  setTracks(tracks) {
    for (const figure of this.figures) {
      this.scene.remove(...figure.parts);
      figure.dispose();
    }
    this.figures = tracks.map((track) => new Figure(track, this.colours));
    for (const figure of this.figures) this.scene.add(...figure.parts);
  }

  setTheme({ background, grid, dark }) {
    this.background = new Color(background);
    this.grid.material.uniforms.colour.value.set(grid).convertLinearToSRGB();
    this.ground.material.opacity = dark ? 0.5 : 0.2;
    this.hemisphere.intensity = dark ? 1.1 : 1.5;
  }

  resize(width, height, pixelRatio) {
    this.renderer.setPixelRatio(pixelRatio);
    this.renderer.setSize(width, height, false);
    this.height = height;
  }

  /** Draw every track at time t; cells are CSS-pixel rectangles from the canvas's top left. */
  draw(t, { blend, trails, orbit, cells }) {
    this.figures.forEach((figure, i) => {
      const { x, y, width, height } = cells[i];
      const { track } = figure;
      const centre = track.centreAt(t);
      const view = orbit.place(centre, track.yaw);
      this.camera.position.fromArray(view.eye);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.camera.lookAt(...view.target);
      for (const other of this.figures) {
        for (const part of other.parts) part.visible = other === figure;
      }
      figure.update(t, blend, trails, view.eye);
      this.#light(centre, track);
      this.renderer.setViewport(x, this.height - y - height, width, height);
      this.renderer.setScissor(x, this.height - y - height, width, height);
      this.renderer.setClearColor(this.background);
      this.renderer.render(this.scene, this.camera);
    });
  }

  // lights stay fixed to the person, so that shading does not change with the viewpoint
  #light(centre, track) {
    const put = (light, x, y, z) => {
      light.position.set(x, y, z).applyAxisAngle(UP, track.yaw);
      light.position.add(light.target.position);
    };
    for (const light of [this.key, this.fill]) light.target.position.fromArray(centre);
    put(this.key, 1.4, 3.2, 2.4);
    put(this.fill, -2.5, 1.0, -1.5);
    for (const plane of [this.ground, this.grid]) plane.position.set(centre[0], track.floor, centre[2]);
    this.grid.position.y += 0.001;
    this.grid.material.uniforms.centre.value = { x: centre[0], y: centre[2] };
  }
}
