// Fields and curves as lines on the surface: glyphs, streamlines, dots.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, InstancedMesh, LineSegments, type Material, Matrix4, Mesh, MeshBasicMaterial, SphereGeometry } from "three";
import type { Surface } from "./surface";

/** Centre and unit normal of a face. */
function frame({ positions: p, triangles: t }: Surface, f: number, centre: number[], normal: number[]): number {
  const a = 3 * t[3 * f], b = 3 * t[3 * f + 1], c = 3 * t[3 * f + 2];
  for (let k = 0; k < 3; k++) centre[k] = (p[a + k] + p[b + k] + p[c + k]) / 3;
  const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
  const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
  normal[0] = uy * vz - uz * vy;
  normal[1] = uz * vx - ux * vz;
  normal[2] = ux * vy - uy * vx;
  const length = Math.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) || 1;
  for (let k = 0; k < 3; k++) normal[k] /= length;
  return length / 2;
}

export interface Places {
  faces: Uint32Array;
  /** How far apart they are, about. */
  spacing: number;
}

/** Faces that are looked at when some are chosen. */
const CANDIDATES = 30_000;

/** Faces spread over the surface by area, about so many, the same ones each time. */
export function spread(surface: Surface, most: number): Places {
  const count = surface.triangles.length / 3;
  // Of a large mesh only some, spread over its numbering.
  const candidates = count <= CANDIDATES ? Uint32Array.from({ length: count }, (_, f) => f) : Uint32Array.from({ length: CANDIDATES }, (_, i) => (i * 2654435761) % count);
  const centre = [0, 0, 0], normal = [0, 0, 0];
  let area = 0;
  for (const f of candidates) area += frame(surface, f, centre, normal);
  area *= count / candidates.length;
  if (count <= most) return { faces: candidates, spacing: Math.sqrt(area / count) };
  for (let cell = Math.sqrt(area / most); ; cell *= 1.2) {
    const taken = new Map<number, number>();
    for (const f of candidates) {
      frame(surface, f, centre, normal);
      // One face in each cell of a grid and each main direction: the two sides of a thin sheet are different places.
      const x = Math.abs(normal[0]), y = Math.abs(normal[1]), z = Math.abs(normal[2]);
      const axis = x > y ? (x > z ? 0 : 2) : y > z ? 1 : 2;
      const side = 2 * axis + (normal[axis] > 0 ? 1 : 0);
      const key = (Math.imul(Math.floor(centre[0] / cell), 73856093) ^ Math.imul(Math.floor(centre[1] / cell), 19349663) ^ Math.imul(Math.floor(centre[2] / cell), 83492791)) * 6 + side;
      if (!taken.has(key)) taken.set(key, f);
    }
    if (taken.size <= 1.3 * most) return { faces: Uint32Array.from(taken.values()), spacing: Math.sqrt(area / taken.size) };
  }
}

/** A vector in the plane of a face, turned around its normal. */
function turned(v: number[], normal: number[], angle: number): number[] {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [
    c * v[0] + s * (normal[1] * v[2] - normal[2] * v[1]),
    c * v[1] + s * (normal[2] * v[0] - normal[0] * v[2]),
    c * v[2] + s * (normal[0] * v[1] - normal[1] * v[0]),
  ];
}

/** How a field is drawn: arrows, n directions at once, or the two axes of a tensor. */
export type Drawing = { kind: "arrows" } | { kind: "star"; n: number } | { kind: "axes" };

/** Flat triangles in one colour: lines of WebGL are one pixel wide whatever is asked for. */
function flat(positions: Float32Array, colour: number): Mesh<BufferGeometry, MeshBasicMaterial> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  const mesh = new Mesh(geometry, new MeshBasicMaterial({ color: colour, side: DoubleSide }));
  mesh.frustumCulled = false;
  return mesh;
}

/** Glyphs of a field at some faces: needles that point where it goes. */
export class Glyphs {
  readonly object: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly positions: Float32Array;

  constructor(private readonly surface: Surface, private readonly places: Places, private readonly drawing: Drawing, private readonly lift: number, colour: number) {
    const needles = { arrows: 1, star: drawing.kind === "star" ? drawing.n : 0, axes: 4 }[drawing.kind];
    this.positions = new Float32Array(9 * needles * places.faces.length);
    this.object = flat(this.positions, colour);
  }

  /** Moves the glyphs to a field: for each face of the mesh one vector in space, or for a tensor its two eigendirections, scaled. */
  set(vectors: Float32Array) {
    const { positions, surface, drawing, places } = this;
    const wide = drawing.kind === "axes" ? 6 : 3;
    const centre = [0, 0, 0], normal = [0, 0, 0];
    const lengths = Float32Array.from(places.faces, (f) => size(vectors, wide * f)).sort();
    const usual = lengths[Math.floor(0.9 * (lengths.length - 1))] || 1;
    let at = 0;
    // A needle from a root along d, as broad at its foot as `foot` says.
    const needle = (root: number[], d: number[], foot: number) => {
      const side = turned(d, normal, Math.PI / 2);
      for (let k = 0; k < 3; k++) {
        positions[at + k] = root[k] + foot * side[k];
        positions[at + 3 + k] = root[k] - foot * side[k];
        positions[at + 6 + k] = root[k] + d[k];
      }
      at += 9;
    };
    for (const f of places.faces) {
      frame(surface, f, centre, normal);
      const root = [0, 1, 2].map((k) => centre[k] + this.lift * normal[k]);
      const scaled = (i: number) => {
        const own = size(vectors, i);
        // Short vectors stay visible: what matters is their direction.
        const s = own > 0 ? (places.spacing * (drawing.kind === "arrows" ? 0.5 + 0.65 * Math.sqrt(Math.min(own / usual, 1)) : 0.75 + 0.3 * Math.min(own / usual, 1))) / own : 0;
        return [s * vectors[i], s * vectors[i + 1], s * vectors[i + 2]];
      };
      const v = scaled(wide * f);
      if (drawing.kind === "star") for (let k = 0; k < drawing.n; k++) needle(root, turned(v, normal, (2 * Math.PI * k) / drawing.n).map((x) => 0.55 * x), 0.13);
      else if (drawing.kind === "axes") {
        // As long as the tensor is large in that direction: a bar where it is so in one only, a cross where in both alike.
        for (const i of [wide * f, wide * f + 3]) {
          const s = (1.05 * places.spacing) / Math.max(usual, size(vectors, wide * f), 1e-30);
          for (const half of [0.5, -0.5]) needle(root, [0, 1, 2].map((k) => half * s * vectors[i + k]), 0.16);
        }
      } else needle([0, 1, 2].map((k) => root[k] - 0.5 * v[k]), v, 0.15);
    }
    (this.object.geometry.getAttribute("position") as BufferAttribute).needsUpdate = true;
  }
}

const size = (values: Float32Array, i: number) => Math.hypot(values[i], values[i + 1], values[i + 2]);

/** Lines on the surface as ribbons. Each has its points and, for each piece between two of them, the face that it lies in. */
export function ribbons(surface: Surface, lines: { points: number[][]; faces: number[] }[], width: number, lift: number, colour: number) {
  let count = 0;
  for (const line of lines) count += line.faces.length;
  const positions = new Float32Array(18 * count);
  const centre = [0, 0, 0], normal = [0, 0, 0];
  let at = 0;
  for (const { points, faces } of lines) {
    faces.forEach((f, i) => {
      const [p, q] = [points[i], points[i + 1]];
      frame(surface, f, centre, normal);
      const d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
      const length = Math.hypot(d[0], d[1], d[2]) || 1;
      const side = turned(d, normal, Math.PI / 2).map((x) => (0.5 * width * x) / length);
      for (const [end, sign] of [[p, 1], [p, -1], [q, 1], [q, 1], [p, -1], [q, -1]] as const) {
        for (let k = 0; k < 3; k++) positions[at + k] = end[k] + sign * side[k] + lift * normal[k];
        at += 3;
      }
    });
  }
  return flat(positions, colour);
}

/** Strands of fur: six numbers each, the root and from there to the tip. */
export function strands(numbers: Float32Array, most: number, width: number, root: number, tip: number) {
  const every = Math.max(1, Math.ceil(numbers.length / 6 / most));
  const count = Math.ceil(numbers.length / 6 / every);
  const positions = new Float32Array(9 * count);
  const colours = new Float32Array(9 * count);
  const [dark, light, mixed] = [new Color(root), new Color(tip), new Color()];
  for (let s = 0; s < count; s++) {
    // Strands differ a little, as hairs do; the same ones each time.
    const shade = ((s * 2654435761) % 1024) / 1024;
    for (const [at, t] of [[0, 0.15 * shade], [3, 0.15 * shade], [6, 0.55 + 0.45 * shade]]) mixed.lerpColors(dark, light, t).toArray(colours, 9 * s + at);
    const [x, y, z, dx, dy, dz] = numbers.subarray(6 * every * s, 6 * every * s + 6);
    // Across the strand, in a direction that differs from strand to strand, so that some are broad from wherever one looks.
    const turn = s * 2.4;
    const across = [dy * Math.sin(turn) - dz * Math.cos(turn), dz * Math.cos(turn * 1.7) - dx * Math.sin(turn), dx * Math.cos(turn) - dy * Math.cos(turn * 1.7)];
    const length = Math.hypot(across[0], across[1], across[2]) || 1;
    const [ax, ay, az] = across.map((v) => (0.5 * width * v) / length);
    positions.set([x + ax, y + ay, z + az, x - ax, y - ay, z - az, x + dx, y + dy, z + dz], 9 * s);
  }
  const object = flat(positions, 0xffffff);
  object.geometry.setAttribute("color", new BufferAttribute(colours, 3));
  object.material.vertexColors = true;
  return { object, count };
}

/** Dots of one size, each in its colour. */
export function dots(places: [x: number, y: number, z: number, colour: number][], size: number): InstancedMesh {
  const mesh = new InstancedMesh(new SphereGeometry(size, 12, 8), new MeshBasicMaterial(), Math.max(places.length, 1));
  mesh.count = places.length;
  const matrix = new Matrix4();
  places.forEach(([x, y, z, colour], i) => {
    mesh.setMatrixAt(i, matrix.makeTranslation(x, y, z));
    mesh.setColorAt(i, new Color(colour));
  });
  mesh.frustumCulled = false;
  return mesh;
}

/** What the edges share with their mesh. */
const SHARED = ["position", "normal", "value"];

/** Edges of a mesh, which move as its vertices do. */
export function wires(mesh: BufferGeometry, ends: Uint32Array, material: Material): LineSegments {
  const geometry = new BufferGeometry();
  for (const name of SHARED) geometry.setAttribute(name, mesh.getAttribute(name));
  geometry.setIndex(new BufferAttribute(ends, 1));
  const lines = new LineSegments(geometry, material);
  lines.frustumCulled = false;
  return lines;
}

/** Leaves to the mesh, which goes on, what its edges shared with it. */
export const unshare = (geometry: BufferGeometry) => SHARED.forEach((name) => geometry.deleteAttribute(name));
