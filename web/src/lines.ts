// Fields and curves as lines on the surface: glyphs, streamlines, dots.

import { BufferAttribute, BufferGeometry, Color, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, MeshBasicMaterial, SphereGeometry } from "three";
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
  const length = Math.hypot(normal[0], normal[1], normal[2]) || 1;
  for (let k = 0; k < 3; k++) normal[k] /= length;
  return length / 2;
}

export interface Places {
  faces: Uint32Array;
  /** How far apart they are, about. */
  spacing: number;
}

/** Faces spread over the surface by area, about so many, the same ones each time. */
export function spread(surface: Surface, most: number): Places {
  const count = surface.triangles.length / 3;
  const centre = [0, 0, 0], normal = [0, 0, 0];
  let area = 0;
  for (let f = 0; f < count; f++) area += frame(surface, f, centre, normal);
  if (count <= most) return { faces: Uint32Array.from({ length: count }, (_, f) => f), spacing: Math.sqrt(area / count) };
  for (let cell = Math.sqrt(area / most); ; cell *= 1.2) {
    const taken = new Map<number, number>();
    for (let f = 0; f < count; f++) {
      frame(surface, f, centre, normal);
      // One face in each cell of a grid and each main direction: the two sides of a thin sheet are different places.
      const sizes = normal.map(Math.abs);
      const axis = sizes[0] > sizes[1] ? (sizes[0] > sizes[2] ? 0 : 2) : sizes[1] > sizes[2] ? 1 : 2;
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

/** Glyphs of a field at some faces. */
export class Glyphs {
  private readonly geometry = new BufferGeometry();
  readonly object = new Group();
  private readonly positions: Float32Array;

  constructor(private readonly surface: Surface, private readonly places: Places, private readonly drawing: Drawing, private readonly lift: number, colour: number) {
    const segments = { arrows: 3, star: drawing.kind === "star" ? drawing.n : 0, axes: 2 }[drawing.kind];
    this.positions = new Float32Array(6 * segments * places.faces.length);
    this.geometry.setAttribute("position", new BufferAttribute(this.positions, 3));
    const lines = new LineSegments(this.geometry, new LineBasicMaterial({ color: colour }));
    lines.frustumCulled = false;
    this.object.add(lines);
  }

  /** Moves the glyphs to a field: for each face of the mesh one vector in space, or for a tensor its two eigendirections, scaled. */
  set(vectors: Float32Array) {
    const { positions, surface, drawing, places } = this;
    const wide = drawing.kind === "axes" ? 6 : 3;
    const centre = [0, 0, 0], normal = [0, 0, 0];
    const lengths = Float32Array.from(places.faces, (f) => size(vectors, wide * f)).sort();
    const usual = lengths[Math.floor(0.9 * (lengths.length - 1))] || 1;
    let at = 0;
    const line = (a: number[], b: number[]) => {
      positions.set(a, at);
      positions.set(b, at + 3);
      at += 6;
    };
    const moved = (a: number[], b: number[], t: number) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
    for (const f of places.faces) {
      frame(surface, f, centre, normal);
      const root = moved(centre, normal, this.lift);
      const scaled = (i: number) => {
        const own = size(vectors, i);
        // Short vectors stay visible: what matters is their direction.
        const s = own > 0 ? (places.spacing * (0.3 + 0.6 * Math.sqrt(Math.min(own / usual, 1)))) / own : 0;
        return [s * vectors[i], s * vectors[i + 1], s * vectors[i + 2]];
      };
      const v = scaled(wide * f);
      if (drawing.kind === "star") for (let k = 0; k < drawing.n; k++) line(root, moved(root, turned(v, normal, (2 * Math.PI * k) / drawing.n), 0.55));
      else if (drawing.kind === "axes") {
        for (const d of [v, scaled(wide * f + 3)]) line(moved(root, d, -0.5), moved(root, d, 0.5));
      } else {
        const tip = moved(root, v, 0.5);
        line(moved(root, v, -0.5), tip);
        for (const angle of [2.6, -2.6]) line(tip, moved(tip, turned(v, normal, angle), 0.3));
      }
    }
    (this.geometry.getAttribute("position") as BufferAttribute).needsUpdate = true;
  }
}

const size = (values: Float32Array, i: number) => Math.hypot(values[i], values[i + 1], values[i + 2]);

/** Polylines in space; each is its points one after the other. */
export function polylines(curves: (number[] | Float32Array)[], colour: number): LineSegments {
  let count = 0;
  for (const curve of curves) count += Math.max(curve.length / 3 - 1, 0);
  const positions = new Float32Array(6 * count);
  let at = 0;
  for (const curve of curves) {
    for (let i = 0; i + 5 < curve.length; i += 3) {
      for (let k = 0; k < 6; k++) positions[at + k] = curve[i + k];
      at += 6;
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ color: colour }));
  lines.frustumCulled = false;
  return lines;
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
