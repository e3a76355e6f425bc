// The surface on the screen: geometry, colours, camera, and what lies under the pointer.

import {
  BufferAttribute, BufferGeometry, DynamicDrawUsage, Euler, type LineSegments, Matrix4, Mesh, MeshBasicMaterial, Object3D, PerspectiveCamera, Plane, Points, Quaternion, Scene, type ShaderMaterial, Sphere, SphereGeometry, Vector3, WebGLRenderer, type WebGLRenderTarget,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { cloud } from "./cloud";
import { Cursor } from "./cursor";
import type { Prepared } from "./geometry";
import { develop, drawnInSoftware, exposure } from "./exposure";
import { unshare, wires } from "./lines";
import { Pace } from "./pace";
import { listen } from "./pointer";
import { portrait } from "./portrait";
import { Shading } from "./shading";
import { record } from "./film";
import { cast, edges, gradient, graze, normals, type Hit, type Surface } from "./surface";
import { unhidden } from "./unhidden";
import { AXES, type Up } from "./upright";

/** Milliseconds without a change after which the picture is drawn as well as it can be. */
const QUIET = 180;
/** Triangles that are drawn in motion without having been tried: by a processor, and by a graphics card. */
const FEW = [60_000, 3_000_000];

/** How far from the pointer a point without faces may be, in radii. */
const NEAR = 0.03;

export interface Scalar {
  values: Float32Array;
  /** What the ends of the colour map stand for; for a diverging map symmetric about zero. */
  range: [number, number];
  diverging: boolean;
}

/** What is cut away: along an axis of the screen (to the right, up, to the viewer), where, and whether the far part of it. */
export interface Slice {
  axis: number;
  at: number;
  far: boolean;
}

export class Viewer {
  readonly canvas: HTMLCanvasElement;
  surface: Surface | null = null;
  centre: [number, number, number] = [0, 0, 0];
  radius = 1;
  /** Pictures drawn, and triangles and pixels of the last: for whoever measures. */
  readonly statistics = { frames: 0, triangles: 0, pixels: 0 };

  onView: () => void = () => {};
  /** Receives a press on the surface; true keeps the camera still, and further points of the stroke follow, "point" if it is done with one. */
  onStroke: ((hit: Hit, phase: "begin" | "move") => boolean | "point") | null = null;
  onStrokeEnd: () => void = () => {};
  onClick: ((hit: Hit) => void) | null = null;
  /** Hears what lies under a pointer that rests on the surface; null where there is nothing. */
  onHover: (hit: Hit | null) => void = () => {};
  /** Hears what the keys do, whenever that changes. */
  onKeys: (hint: string) => void = () => {};
  readonly cursor = new Cursor(this);

  private readonly renderer: WebGLRenderer;
  private readonly software: boolean;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(32, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly shading = new Shading();
  private readonly pace = new Pace();
  private readonly mesh: Mesh<BufferGeometry>;
  /** What stands in for the mesh where there are points without faces. */
  private points: Points<BufferGeometry> | null = null;
  private readonly developed = exposure();
  private readonly overlays = new Map<string, Object3D>();
  private upward: Up = "y";
  private readonly upright = new Quaternion();
  private levels: BufferAttribute[] = [];
  private rest: Float32Array | null = null;
  private scheduled = false;
  private changed = false;
  private measured = false;
  private held = false;
  private quiet = 0;
  private last = 0;
  private frame: ((time: number) => boolean) | null = null;
  /** Whether what is on the screen is as good as it gets. */
  fine = false;

  constructor(canvas: HTMLCanvasElement) {
    this.canvas = canvas;
    this.software = drawnInSoftware();
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.software, alpha: false, powerPreference: "high-performance" });
    // An opaque canvas needs no blending with the page, so the page's colour is its background.
    const back = () => {
      this.renderer.setClearColor(getComputedStyle(canvas).getPropertyValue("--stage").trim(), 1);
      this.draw();
    };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", back);
    queueMicrotask(back);
    this.mesh = new Mesh<BufferGeometry>(new BufferGeometry(), this.shading.fine);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.scene.add(this.mesh);
    this.camera.position.set(0.9, 0.55, 3.6);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("start", () => (this.held = true));
    this.controls.addEventListener("end", () => {
      this.held = false;
      this.draw();
    });
    this.controls.addEventListener("change", () => {
      this.draw();
      this.onView();
    });
    this.map("blue-orange");
    this.compile();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    listen(this, this.controls);
  }

  /** Has the shaders compiled: later the page would wait for them, and for everything that is drawn in front of them. */
  private compile() {
    const geometry = new BufferGeometry();
    for (const [name, size] of [["position", 3], ["normal", 3], ["value", 1]] as const) geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * size), size));
    geometry.setIndex([0, 1, 2]);
    this.mesh.geometry = geometry;
    this.mesh.visible = true;
    for (const material of [this.shading.fine, this.shading.quick]) {
      this.mesh.material = material;
      this.renderer.render(this.scene, this.camera);
    }
    this.mesh.visible = false;
  }

  /** Shows another mesh, so that it fills the unit ball. Where it is closed, the far side is not drawn. */
  setMesh(surface: Prepared, closed: boolean) {
    this.shading.sides(closed, surface.volume);
    this.slice(null);
    this.shading.tint(false);
    [this.centre, this.radius] = [surface.centre, surface.radius];
    this.guessed = surface.up;
    this.up = surface.up;
    this.rest = surface.positions;
    this.surface = { positions: surface.positions, triangles: surface.triangles };
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(surface.positions, 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("normal", new BufferAttribute(surface.normals, 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("value", new BufferAttribute(new Float32Array(surface.positions.length / 3), 1).setUsage(DynamicDrawUsage));
    // Known already: three.js would read every vertex again.
    geometry.boundingSphere = new Sphere(new Vector3(...surface.centre), surface.radius);
    const bare = surface.triangles.length === 0;
    this.levels = bare ? [] : surface.levels.map((level) => new BufferAttribute(level, 1));
    geometry.setIndex(this.levels[0] ?? null);
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
    this.mesh.visible = !bare;
    if (this.points) this.scene.remove(this.points);
    this.points = bare ? cloud(geometry, this.shading) : null;
    if (this.points) this.scene.add(this.points);
    this.pace.begin(surface.levels.map((level) => level.length / 3), FEW[this.software ? 0 : 1]);
    this.cursor.leave();
    for (const name of [...this.overlays.keys()]) this.overlay(name, null);
    this.setScalar(null);
    for (const object of this.shown) this.place(object);
    this.draw();
  }

  /** The mesh, and the points that stand in for it. */
  private get shown(): (Mesh<BufferGeometry> | Points<BufferGeometry>)[] {
    return this.points ? [this.mesh, this.points] : [this.mesh];
  }

  /** Which way is up in the mesh that is shown, as far as can be guessed. */
  guessed: Up = "y";

  /** Shows no mesh. */
  clear() {
    for (const name of [...this.overlays.keys()]) this.overlay(name, null);
    this.animate(null);
    this.surface = this.rest = null;
    this.levels = [];
    this.mesh.visible = false;
    if (this.points) this.scene.remove(this.points);
    this.points = null;
    this.draw();
  }

  /** Puts an object that is given in the units of the mesh into the frame of the scene. */
  private place(object: Object3D) {
    object.scale.setScalar(1 / this.radius);
    object.quaternion.copy(this.upright);
    object.position.set(...this.centre).multiplyScalar(-1 / this.radius).applyQuaternion(this.upright);
  }

  /** Which axis of the mesh points up. */
  get up(): Up {
    return this.upward;
  }

  set up(up: Up) {
    this.upward = up;
    const rows = AXES[up].map(([axis, sign]) => [0, 1, 2].map((k) => (k === axis ? sign : 0)));
    this.upright.setFromRotationMatrix(new Matrix4().set(...[...rows[0], 0, ...rows[1], 0, ...rows[2], 0, 0, 0, 0, 1] as Parameters<Matrix4["set"]>));
    for (const object of [...this.shown, ...this.overlays.values()]) this.place(object);
    this.slice(this.cut);
  }

  /** A point of the scene, in radii around the middle of the mesh, in the units of the mesh. */
  fromScene(point: [number, number, number]): [number, number, number] {
    const [x, y, z] = new Vector3(...point).applyQuaternion(this.upright.clone().invert()).multiplyScalar(this.radius).toArray();
    return [this.centre[0] + x, this.centre[1] + y, this.centre[2] + z];
  }

  /** Moves the vertices, or with `null` back to where they were. */
  setPositions(positions: Float32Array | null) {
    if (!this.rest || !this.surface) return;
    const wanted = positions ?? this.rest;
    if (wanted.length !== this.rest.length) return;
    if (this.surface.positions === wanted) return;
    this.surface.positions = wanted;
    const geometry = this.mesh.geometry;
    const at = geometry.getAttribute("position") as BufferAttribute;
    const facing = geometry.getAttribute("normal") as BufferAttribute;
    at.array = wanted;
    at.needsUpdate = true;
    normals(this.surface, facing.array as Float32Array<ArrayBuffer>);
    facing.needsUpdate = true;
    this.draw();
  }

  /** Colours the surface by one value for each vertex. */
  setScalar(scalar: Scalar | null) {
    const values = this.mesh.geometry.getAttribute("value") as BufferAttribute | undefined;
    if (scalar && (!values || values.count !== scalar.values.length)) return;
    this.shading.values(scalar && scalar.range, scalar?.diverging);
    if (scalar) this.setValues(scalar.values);
    this.draw();
  }

  /** Other values on the scale of those before. */
  setValues(numbers: Float32Array) {
    const values = this.mesh.geometry.getAttribute("value") as BufferAttribute;
    values.array = numbers;
    values.needsUpdate = true;
    if (this.mesh.geometry.hasAttribute("slope")) this.steepen();
    this.draw();
  }

  /** Colours the surface itself, by three numbers from 0 to 1 for each vertex, with so many checks along each axis; `null` ends it. */
  tint(colours: Float32Array | null, checks = 0) {
    const { geometry } = this.mesh;
    if (colours) geometry.setAttribute("tint", new BufferAttribute(colours, 3));
    else geometry.deleteAttribute("tint");
    this.shading.tint(colours !== null, checks);
    this.draw();
  }

  /** Cuts away what lies beyond a part of the extent along an axis of the screen, from 0 to 1; `null` gives all of it back. */
  slice(cut: Slice | null) {
    this.cut = cut;
    this.shading.opened(cut !== null);
    this.renderer.clippingPlanes = [];
    const p = this.rest;
    if (cut && p) {
      const normal = new Vector3().setComponent(cut.axis, cut.far ? -1 : 1);
      const [axis, sign] = AXES[this.upward][cut.axis];
      let [low, high] = [Infinity, -Infinity];
      for (let i = axis; i < p.length; i += 3) {
        low = Math.min(low, p[i]);
        high = Math.max(high, p[i]);
      }
      const at = (sign * ((sign > 0 ? low + cut.at * (high - low) : high - cut.at * (high - low)) - this.centre[axis])) / this.radius;
      this.renderer.clippingPlanes = [new Plane(normal, cut.far ? at : -at)];
    }
    this.draw();
  }

  private cut: Slice | null = null;

  /** Chooses the colour map. */
  map(name: string) {
    if (this.shading.map(name)) this.draw();
  }

  /** How many isolines there are; 0 for none. */
  lines(count: number) {
    this.shading.lines(count);
    this.draw();
  }

  /** Moves the surface along its normals by its values, times this part of the radius; `null` ends it. */
  wave(amount: number | null) {
    const { geometry } = this.mesh;
    if (amount !== null && !geometry.hasAttribute("slope")) this.steepen();
    if (amount === null) geometry.deleteAttribute("slope");
    this.shading.wave((amount ?? 0) * this.radius);
    this.draw();
  }

  /** The slope of the values, from which follow the normals of a wave. */
  private steepen() {
    const { geometry } = this.mesh;
    const known = geometry.getAttribute("slope") as BufferAttribute | undefined;
    if (!this.surface) return;
    const slope = gradient(this.surface, (geometry.getAttribute("value") as BufferAttribute).array as Float32Array, known?.array as Float32Array<ArrayBuffer> | undefined);
    if (known) known.needsUpdate = true;
    else geometry.setAttribute("slope", new BufferAttribute(slope, 3).setUsage(DynamicDrawUsage));
  }

  /** Adds, replaces or takes away an object drawn with the surface, in the units of the mesh. */
  overlay(name: string, object: Object3D | null) {
    const before = this.overlays.get(name);
    if (before) {
      this.scene.remove(before);
      if (name === "edges") unshare((before as LineSegments).geometry);
      before.traverse((part) => (part as Mesh).geometry?.dispose());
      this.overlays.delete(name);
    }
    if (object) {
      this.place(object);
      this.overlays.set(name, object);
      this.scene.add(object);
    }
    this.draw();
  }

  /** A dot on a vertex. */
  mark(name: string, vertex: number | null, colour = 0xd81b60) {
    if (vertex === null || !this.surface) return this.overlay(name, null);
    const dot = new Mesh(new SphereGeometry(0.016 * this.radius, 16, 12), new MeshBasicMaterial({ color: colour }));
    dot.geometry.translate(...(this.surface.positions.slice(3 * vertex, 3 * vertex + 3) as unknown as [number, number, number]));
    this.overlay(name, dot);
  }

  /** Calls `frame` with the seconds before each picture until it says false or is replaced. */
  animate(frame: ((time: number) => boolean) | null) {
    this.frame = frame;
    this.draw();
  }

  /** Whether something is animated. */
  get moving(): boolean {
    return this.frame !== null;
  }

  /** Draws as soon as the screen is ready for it. */
  draw() {
    this.changed = true;
    this.fine = false;
    this.schedule();
  }

  private schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((time) => this.tick(time));
  }

  private tick(time: number) {
    this.scheduled = false;
    const interval = time - this.last;
    this.last = time;
    if (this.measured && interval < 400) this.pace.note(interval);
    if (this.frame && !this.frame(time / 1000)) this.frame = null;
    const continuous = this.frame !== null || this.held;
    if (!continuous) this.pace.rest();
    this.measured = continuous && this.changed;
    if (this.changed) {
      this.changed = false;
      this.picture(false);
      window.clearTimeout(this.quiet);
      this.quiet = window.setTimeout(() => this.rested(), QUIET);
    }
    if (this.frame) this.schedule();
  }

  /** What moves is drawn with what the machine can do in time; what stands still, as well as it can be. */
  private rested() {
    if (this.changed || this.held || this.frame) {
      this.quiet = window.setTimeout(() => this.rested(), QUIET);
      return;
    }
    if (this.software) this.develop();
    else this.picture(true);
  }

  /** Draws the fine picture out of sight, and shows it once it is whole. */
  private develop() {
    const { renderer, scene, camera } = this;
    const { geometry } = this.mesh;
    const corners = this.levels[0];
    const { clientWidth, clientHeight } = this.canvas;
    const begin = () => {
      if (this.changed || this.frame || this.held || this.mesh.geometry !== geometry) return false;
      if (corners) geometry.setIndex(corners);
      this.dress(this.shading.fine);
      return true;
    };
    develop({ renderer, scene, camera, geometry, corners: corners?.count ?? (this.points ? geometry.getAttribute("position").count : 0), width: clientWidth * this.ratio, height: clientHeight * this.ratio, begin, done: (target) => this.expose(target) });
  }

  /** Shows a picture that was drawn out of sight. */
  private expose(target: WebGLRenderTarget) {
    this.renderer.setPixelRatio(this.ratio);
    this.developed.material.uniforms.picture.value = target.texture;
    this.renderer.render(this.developed, this.camera);
    this.count(this.levels[0]);
    this.fine = true;
  }

  private count(corners: BufferAttribute | undefined) {
    this.statistics.frames += 1;
    this.statistics.triangles = (corners?.count ?? 0) / 3;
    this.statistics.pixels = this.canvas.width * this.canvas.height;
  }

  private picture(fine: boolean) {
    const { level, scale } = this.pace.rung;
    const pixels = fine ? this.ratio : this.ratio * scale;
    const { geometry } = this.mesh;
    const corners = this.levels[fine ? 0 : level];
    const material = fine || !this.software ? this.shading.fine : this.shading.quick;
    // On a graphics card the quick picture mostly is the fine one.
    const same = Math.abs(pixels - this.renderer.getPixelRatio()) < 0.02 * pixels && (!corners || geometry.index === corners) && this.mesh.material === material;
    this.fine ||= fine;
    if (fine && same) return;
    if (!same) {
      if (corners) geometry.setIndex(corners);
      this.dress(material);
      this.renderer.setPixelRatio(pixels);
    }
    this.renderer.render(this.scene, this.camera);
    this.count(corners);
  }

  private dress(material: ShaderMaterial) {
    for (const object of this.shown) object.material = material;
  }

  private get ratio() {
    return Math.min(window.devicePixelRatio || 1, 2);
  }

  private resize() {
    const box = this.canvas.parentElement!;
    const [width, height] = [box.clientWidth, box.clientHeight];
    if (!width || !height) return;
    this.camera.aspect = width / height;
    // A narrow window shows the whole surface too.
    this.camera.zoom = 0.96 * Math.min(1, this.camera.aspect);
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height, false);
    this.draw();
  }

  // --- camera ---------------------------------------------------------------------------------------------------------

  /** The camera as text: position and target in radii of the mesh. */
  get view(): string {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()].map((x) => x.toFixed(2)).join(",");
  }

  set view(text: string | undefined) {
    const numbers = (text ?? "").split(",").map(Number);
    const known = numbers.length === 6 && numbers.every(Number.isFinite);
    const [x, y, z, tx, ty, tz] = known ? numbers : [0.9, 0.55, 3.6, 0, 0, 0];
    this.camera.position.set(x, y, z);
    this.controls.target.set(tx, ty, tz);
    this.controls.update();
    this.draw();
  }

  /** Looks at its surface as another viewer looks at its own. */
  follow(other: Viewer) {
    this.camera.position.copy(other.camera.position);
    this.controls.target.copy(other.controls.target);
    this.controls.update();
    this.draw();
  }

  /** Turns by angles in radians, or comes closer by a factor. */
  turn(across: number, up: number, closer = 1) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const right = new Vector3().crossVectors(this.camera.up, offset).normalize();
    offset.applyQuaternion(new Quaternion().setFromEuler(new Euler(0, -across, 0)));
    const tilted = offset.clone().applyQuaternion(new Quaternion().setFromAxisAngle(right, -up));
    if (Math.abs(tilted.clone().normalize().y) < 0.99) offset.copy(tilted);
    this.camera.position.copy(this.controls.target).add(offset.multiplyScalar(1 / closer));
    this.controls.update();
    this.draw();
    this.onView();
  }

  // --- what is taken away ----------------------------------------------------------------------------------------------

  /** The surface as it is seen: where something moves it along its normals, at this moment. */
  shape(): Surface | null {
    if (!this.surface) return null;
    const { positions, triangles } = this.surface;
    const moved = positions.slice();
    const amount = this.shading.waving;
    const normals = this.mesh.geometry.getAttribute("normal").array;
    const values = this.mesh.geometry.getAttribute("value").array;
    if (amount !== 0) for (let i = 0; i < moved.length; i++) moved[i] += amount * values[Math.floor(i / 3)] * normals[i];
    return { positions: moved, triangles };
  }

  /** What is on the screen as a PNG, twice as fine. */
  snapshot(): Promise<Blob> {
    if (this.levels[0]) this.mesh.geometry.setIndex(this.levels[0]);
    this.dress(this.shading.fine);
    this.renderer.setPixelRatio(2 * this.ratio);
    this.renderer.render(this.scene, this.camera);
    const done = new Promise<Blob>((resolve, reject) => this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("the browser made no picture"))), "image/png"));
    this.renderer.setPixelRatio(this.ratio);
    this.draw();
    return done;
  }

  /** A small picture of another surface. */
  readonly portrait = (surface: Prepared): ImageData => portrait(this.renderer, surface);

  /** A film of one turn around the vertical axis, as WebM; what swings goes on swinging. */
  async film(seconds: number): Promise<Blob> {
    const before = this.view;
    this.held = true;
    try {
      return await record(this.canvas, seconds, (part) => this.turn(2 * Math.PI * part, 0));
    } finally {
      this.held = false;
      this.view = before;
      this.onView();
    }
  }

  /** Shows the edges of the mesh. */
  edges(on: boolean) {
    if (!on || !this.surface) return this.overlay("edges", null);
    this.overlay("edges", wires(this.mesh.geometry, edges(this.surface), this.shading.edges));
  }

  /** Lines in the units of the mesh as they are seen in the window: only the parts that nothing hides. */
  drawn(lines: number[][][]): { width: number; height: number; runs: [number, number][][] } {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.levels[0]) this.mesh.geometry.setIndex(this.levels[0]);
    const others = [...this.overlays.values()].filter((object) => object.visible);
    others.forEach((object) => (object.visible = false));
    const runs = unhidden(this.renderer, this.scene, this.camera, this.mesh, lines, width, height);
    others.forEach((object) => (object.visible = true));
    this.draw();
    return { width, height, runs };
  }

  // --- what lies under the pointer --------------------------------------------------------------------------------------

  /** The surface under a point of the window. */
  pick(x: number, y: number): Hit | null {
    if (!this.surface) return null;
    const box = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const near = new Vector3((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height, -1).unproject(this.camera);
    const far = new Vector3((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height, 1).unproject(this.camera);
    this.mesh.updateMatrixWorld();
    const inverse = this.mesh.matrixWorld.clone().invert();
    const origin = near.applyMatrix4(inverse);
    const ray = far.applyMatrix4(inverse).sub(origin).normalize();
    // In the frame of the mesh the plane of a slice has its own numbers.
    const [plane] = this.renderer.clippingPlanes.map((plane) => plane.clone().applyMatrix4(inverse));
    const cut = plane && [...plane.normal.toArray(), plane.constant];
    return this.points ? graze(this.surface, origin.toArray(), ray.toArray(), NEAR * this.radius, cut) : cast(this.surface, origin.toArray(), ray.toArray(), cut);
  }

  /** The vertices where they were before anything moved them. */
  get resting(): Float32Array | null {
    return this.rest;
  }

  /** The unit normal of a vertex. */
  normalAt(vertex: number): number[] | null {
    const facing = this.mesh.geometry.getAttribute("normal") as BufferAttribute | undefined;
    return facing ? [facing.getX(vertex), facing.getY(vertex), facing.getZ(vertex)] : null;
  }

  /** Where a vertex stands in the window. */
  project(vertex: number): [x: number, y: number] {
    const p = this.surface!.positions;
    return this.window([p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2]]);
  }

  /** Where a point in the units of the mesh stands in the window. */
  window(point: [number, number, number]): [x: number, y: number] {
    this.mesh.updateMatrixWorld();
    this.camera.updateMatrixWorld();
    const at = new Vector3(...point).applyMatrix4(this.mesh.matrixWorld).project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return [box.left + (box.width * (at.x + 1)) / 2, box.top + (box.height * (1 - at.y)) / 2];
  }

  /** Whether a point of the window lies on the canvas, and not too near to its edge. */
  inside(x: number, y: number, margin: number): boolean {
    const box = this.canvas.getBoundingClientRect();
    const [s, t] = [(x - box.left) / box.width, (y - box.top) / box.height];
    return s > margin && s < 1 - margin && t > margin && t < 1 - margin;
  }

  /** What lies in the middle of the canvas, or nearest to it on a level line. */
  middle(): Hit | null {
    const box = this.canvas.getBoundingClientRect();
    for (let t = 0; t < 0.5; t += 0.01) {
      for (const side of [1, -1]) {
        const hit = this.pick(box.left + box.width * (0.5 + side * t), box.top + 0.5 * box.height);
        if (hit) return hit;
      }
    }
    return null;
  }
}
