// The surface on the screen: geometry, colours, camera, and what lies under the pointer.

import {
  BackSide, BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, Euler, FrontSide, GLSL3, LinearFilter, Mesh, Object3D, PerspectiveCamera, Quaternion,
  RGBAFormat, Scene, ShaderMaterial, Vector2, Vector3, WebGLRenderer, DynamicDrawUsage, SphereGeometry, MeshBasicMaterial,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { MAPS, table } from "./colours";
import { bounds, cast, normals, volume, type Hit, type Surface } from "./surface";

const VERTEX = `
in float value;
uniform float wave;
out float v_value;
out vec3 v_normal;
out vec3 v_position;
void main() {
  vec4 at = modelViewMatrix * vec4(position + wave * value * normal, 1.0);
  v_value = value;
  v_normal = normalMatrix * normal;
  v_position = at.xyz;
  gl_Position = projectionMatrix * at;
}`;

// Isolines are as wide on the screen as on paper, however steep the function: their distance is measured in its own derivative.
const FRAGMENT = `
precision highp float;
in float v_value;
in vec3 v_normal;
in vec3 v_position;
uniform sampler2D map;
uniform vec2 range;
uniform float lines;
uniform float coloured;
uniform float diverging;
uniform vec3 plain;
uniform float bend;
out vec4 colour;
void main() {
  // Where the surface moves, its normals are those of its triangles on the screen.
  vec3 flat_normal = cross(dFdx(v_position), dFdy(v_position));
  vec3 n = normalize(mix(v_normal, flat_normal, bend));
  if (dot(n, v_position) > 0.0) n = -n;
  vec3 base = plain;
  if (coloured > 0.5) {
    float t = clamp((v_value - range.x) / max(range.y - range.x, 1e-30), 0.0, 1.0);
    base = texture(map, vec2(0.001953125 + t * 0.99609375, 0.5)).rgb;
    if (lines > 0.5) {
      float s = t * lines;
      float w = fwidth(s);
      float d = abs(fract(s - 0.5) - 0.5) / max(w, 1e-9);
      float ink = (1.0 - smoothstep(0.35, 1.1, d)) * (1.0 - smoothstep(0.35, 0.9, w));
      if (diverging > 0.5) {
        float zero = abs(t - 0.5) / max(fwidth(t), 1e-9);
        ink = max(0.55 * ink, 1.0 - smoothstep(0.9, 1.7, zero));
      } else ink *= 0.6;
      base = mix(base, vec3(0.06), ink);
    }
  }
  vec3 eye = normalize(-v_position);
  float head = max(dot(n, eye), 0.0);
  float above = 0.5 + 0.5 * n.y;
  float key = max(dot(n, vec3(0.36, 0.56, 0.74)), 0.0);
  float light = 0.34 + 0.16 * above + 0.26 * head + 0.36 * key;
  float shine = 0.10 * pow(max(dot(reflect(vec3(-0.36, -0.56, -0.74), n), eye), 0.0), 24.0);
  colour = vec4(min(base * light + shine, 1.0), 1.0);
}`;

/** Frames slower than this, in milliseconds, are drawn with fewer pixels while things move. */
const SLOW = 30;

export interface Scalar {
  values: Float32Array;
  /** What the ends of the colour map stand for; for a diverging map symmetric about zero. */
  range: [number, number];
  diverging: boolean;
}

/** Whether a processor does the work of a graphics card. Smooth edges then come from more pixels, and only once nothing moves. */
function drawnInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const software = !!context && !!names && /swiftshader|llvmpipe|software/i.test(String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)));
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return software;
}

export class Viewer {
  readonly canvas: HTMLCanvasElement;
  surface: Surface | null = null;
  centre: [number, number, number] = [0, 0, 0];
  radius = 1;
  /** Frames drawn and the milliseconds between the last of them: for whoever measures. */
  readonly statistics = { frames: 0, interval: 0 };

  onView: () => void = () => {};
  /** Receives a press on the surface; true keeps the camera still, and further points of the stroke follow. */
  onStroke: ((hit: Hit, phase: "begin" | "move") => boolean) | null = null;
  onStrokeEnd: () => void = () => {};
  onClick: ((hit: Hit) => void) | null = null;

  private readonly renderer: WebGLRenderer;
  private readonly software: boolean;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(32, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly material: ShaderMaterial;
  private readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;
  private readonly overlays = new Map<string, Object3D>();
  private rest: Float32Array | null = null;
  private drawn = false;
  private scale = 1;
  private held = false;
  private live = false;
  private last = 0;
  private frame: ((time: number) => boolean) | null = null;

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
    this.material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: DoubleSide,
      uniforms: {
        map: { value: null }, range: { value: new Vector2(-1, 1) }, lines: { value: 0 }, coloured: { value: 0 }, diverging: { value: 1 },
        plain: { value: new Color(0.8, 0.79, 0.76) }, wave: { value: 0 }, bend: { value: 0 },
      },
    });
    this.mesh = new Mesh(new BufferGeometry(), this.material);
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
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.listen();
  }

  /** Shows another mesh, so that it fills the unit ball. Where it is closed, the far side is not drawn. */
  setMesh(surface: Surface, closed: boolean) {
    this.material.side = closed ? (volume(surface) > 0 ? FrontSide : BackSide) : DoubleSide;
    this.material.needsUpdate = true;
    const { centre, radius } = bounds(surface);
    [this.centre, this.radius] = [centre, radius];
    this.rest = surface.positions;
    this.surface = { positions: surface.positions, triangles: surface.triangles };
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(surface.positions, 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("normal", new BufferAttribute(normals(surface), 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("value", new BufferAttribute(new Float32Array(surface.positions.length / 3), 1).setUsage(DynamicDrawUsage));
    geometry.setIndex(new BufferAttribute(surface.triangles, 1));
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
    this.mesh.visible = true;
    for (const name of [...this.overlays.keys()]) this.overlay(name, null);
    this.setScalar(null);
    this.place(this.mesh);
    this.draw();
  }

  /** Puts an object that is given in the units of the mesh into the frame of the scene. */
  private place(object: Object3D) {
    object.scale.setScalar(1 / this.radius);
    object.position.set(-this.centre[0] / this.radius, -this.centre[1] / this.radius, -this.centre[2] / this.radius);
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
    facing.array = normals(this.surface, facing.array as Float32Array<ArrayBuffer>);
    facing.needsUpdate = true;
    this.draw();
  }

  /** Colours the surface by one value for each vertex. */
  setScalar(scalar: Scalar | null) {
    const uniforms = this.material.uniforms;
    uniforms.coloured.value = scalar ? 1 : 0;
    if (scalar) {
      const values = this.mesh.geometry.getAttribute("value") as BufferAttribute | undefined;
      if (!values || values.count !== scalar.values.length) return;
      values.array = scalar.values;
      values.needsUpdate = true;
      uniforms.range.value.set(...scalar.range);
      uniforms.diverging.value = scalar.diverging ? 1 : 0;
    }
    this.draw();
  }

  /** Chooses the colour map. */
  map(name: string) {
    const map = MAPS[name] ?? MAPS["blue-orange"];
    const texture = new DataTexture(table(map), 256, 1, RGBAFormat);
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    (this.material.uniforms.map.value as DataTexture | null)?.dispose();
    this.material.uniforms.map.value = texture;
    this.draw();
  }

  /** How many isolines there are; 0 for none. */
  lines(count: number) {
    this.material.uniforms.lines.value = count;
    this.draw();
  }

  /** Moves the surface along its normals by its values, times this part of the radius; normals then follow the triangles. */
  wave(amount: number, bend: boolean) {
    this.material.uniforms.wave.value = amount * this.radius;
    this.material.uniforms.bend.value = bend ? 1 : 0;
    this.draw();
  }

  /** Adds, replaces or takes away an object drawn with the surface, in the units of the mesh. */
  overlay(name: string, object: Object3D | null) {
    const before = this.overlays.get(name);
    if (before) {
      this.scene.remove(before);
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

  /** Draws as soon as the screen is ready for it. */
  draw() {
    if (this.drawn) return;
    this.drawn = true;
    requestAnimationFrame((time) => this.picture(time));
  }

  private picture(time: number) {
    this.drawn = false;
    const interval = time - this.last;
    this.last = time;
    const moving = this.frame !== null && this.frame(time / 1000);
    if (!moving) this.frame = null;
    const live = moving || this.held;
    if (live && this.live) {
      // What moves is drawn with as many pixels as the machine can do in time; what stands still, with all of them.
      this.statistics.interval += 0.2 * (Math.min(interval, 250) - this.statistics.interval);
      const steady = this.statistics.interval;
      if (steady > SLOW) this.scale = Math.max(0.35, this.scale * 0.9);
      else if (steady < 0.6 * SLOW) this.scale = Math.min(1, this.scale * 1.03);
    }
    this.live = live;
    const still = this.software && this.ratio < 1.5 ? 1.75 * this.ratio : this.ratio;
    const pixels = live ? this.ratio * this.scale : still;
    if (Math.abs(pixels - this.renderer.getPixelRatio()) > 0.04 * pixels) this.renderer.setPixelRatio(pixels);
    this.renderer.render(this.scene, this.camera);
    this.statistics.frames += 1;
    if (moving) this.draw();
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

  // --- what lies under the pointer --------------------------------------------------------------------------------------

  /** The surface under a point of the window. */
  pick(x: number, y: number): Hit | null {
    if (!this.surface) return null;
    const box = this.canvas.getBoundingClientRect();
    const near = new Vector3((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height, -1).unproject(this.camera);
    const far = new Vector3((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height, 1).unproject(this.camera);
    this.mesh.updateMatrixWorld();
    const inverse = this.mesh.matrixWorld.clone().invert();
    const origin = near.applyMatrix4(inverse);
    const ray = far.applyMatrix4(inverse).sub(origin).normalize();
    return cast(this.surface, origin.toArray(), ray.toArray());
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
    this.mesh.updateMatrixWorld();
    const at = new Vector3(p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2]).applyMatrix4(this.mesh.matrixWorld).project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return [box.left + (box.width * (at.x + 1)) / 2, box.top + (box.height * (1 - at.y)) / 2];
  }

  private listen() {
    const { canvas } = this;
    let stroke = false;
    let down: { x: number; y: number; hit: Hit | null } | null = null;
    // Before the controls see it: a stroke keeps the camera still.
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !event.isPrimary) return;
      const hit = this.onStroke || this.onClick ? this.pick(event.clientX, event.clientY) : null;
      down = { x: event.clientX, y: event.clientY, hit };
      if (hit && this.onStroke?.(hit, "begin")) {
        stroke = true;
        this.controls.enabled = false;
        canvas.setPointerCapture(event.pointerId);
      }
    }, { capture: true });
    canvas.addEventListener("pointermove", (event) => {
      if (!stroke) return;
      const hit = this.pick(event.clientX, event.clientY);
      if (hit) this.onStroke?.(hit, "move");
    });
    const end = (event: PointerEvent) => {
      const moved = down ? Math.hypot(event.clientX - down.x, event.clientY - down.y) : 0;
      if (stroke) {
        stroke = false;
        this.controls.enabled = true;
        this.onStrokeEnd();
      } else if (down?.hit && moved < 5 && event.type === "pointerup") this.onClick?.(down.hit);
      down = null;
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 0.4 : 0.1;
      const moves: Record<string, () => void> = {
        ArrowLeft: () => this.turn(step, 0), ArrowRight: () => this.turn(-step, 0),
        ArrowUp: () => this.turn(0, -step), ArrowDown: () => this.turn(0, step),
        "+": () => this.turn(0, 0, 1.15), "=": () => this.turn(0, 0, 1.15), "-": () => this.turn(0, 0, 1 / 1.15),
        Home: () => { this.view = undefined; this.onView(); },
      };
      const move = event.ctrlKey || event.metaKey || event.altKey ? undefined : moves[event.key];
      if (!move) return;
      event.preventDefault();
      move();
    });
  }
}
