// Fields and curves as lines on the surface: glyphs, streamlines, dots.

import { BufferAttribute, BufferGeometry, Color, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, MeshBasicMaterial, SphereGeometry } from "three";
import type { Surface } from "./surface";

/** How far lines stand above the surface, in radii of the mesh: near enough to belong to it, far enough not to sink in. */
const ABOVE = 0.004;

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

/** Faces spread over the surface by area, at most so many, the same ones each time. */
export function spread(surface: Surface, most: number): Uint32Array {
  const faces = surface.triangles.length / 3;
  if (faces <= most) return Uint32Array.from({ length: faces }, (_, f) => f);
  const centre = [0, 0, 0], normal = [0, 0, 0];
  let area = 0;
  for (let f = 0; f < faces; f++) area += frame(surface, f, centre, normal);
  // One face in each cell of a grid whose cells hold, on average, the wanted share of the area.
  let cell = Math.sqrt(area / most);
  for (;;) {
    const taken = new Map<string, number>();
    for (let f = 0; f < faces; f++) {
      frame(surface, f, centre, normal);
      // The two sides of a thin sheet are different places.
      const side = (normal[0] > 0 ? 1 : 0) + (normal[1] > 0 ? 2 : 0) + (normal[2] > 0 ? 4 : 0);
      const key = `${Math.floor(centre[0] / cell)},${Math.floor(centre[1] / cell)},${Math.floor(centre[2] / cell)},${side >> (Math.abs(normal[0]) > 0.9 ? 0 : 1)}`;
      if (!taken.has(key)) taken.set(key, f);
    }
    if (taken.size <= 1.25 * most) return Uint32Array.from(taken.values());
    cell *= 1.2;
  }
}

/**
 * Glyphs of a field. `vectors` has `roots` vectors in space for each face of the mesh, face after face; lines run to both sides where
 * the field has no sign, and are arrows where it has.
 */
export class Glyphs {
  private readonly geometry = new BufferGeometry();
  private readonly lines: LineSegments;
  readonly object = new Group();
  private readonly positions: Float32Array;
  private readonly colours: Float32Array;

  constructor(private readonly surface: Surface, private readonly faces: Uint32Array, private readonly roots: number, private readonly radius: number, private readonly colour = 0x14161a) {
    const segments = faces.length * roots * (roots === 1 ? 3 : 1);
    this.positions = new Float32Array(6 * segments);
    this.colours = new Float32Array(6 * segments);
    this.geometry.setAttribute("position", new BufferAttribute(this.positions, 3));
    this.geometry.setAttribute("color", new BufferAttribute(this.colours, 3));
    this.lines = new LineSegments(this.geometry, new LineBasicMaterial({ vertexColors: true }));
    this.lines.frustumCulled = false;
    this.object.add(this.lines);
  }

  /** Moves the glyphs to another field. */
  set(vectors: Float32Array) {
    const { faces, roots, positions, colours, surface } = this;
    const centre = [0, 0, 0], normal = [0, 0, 0];
    let most = 0;
    for (const f of faces) for (let r = 0; r < roots; r++) most = Math.max(most, size(vectors, 3 * (roots * f + r)));
    const length = 0.62 * Math.sqrt((12 * this.radius * this.radius) / Math.max(faces.length, 1)) ;
    const ink = new Color(this.colour);
    let at = 0;
    const put = (x: number, y: number, z: number) => {
      positions[at] = x; positions[at + 1] = y; positions[at + 2] = z;
      colours[at] = ink.r; colours[at + 1] = ink.g; colours[at + 2] = ink.b;
      at += 3;
    };
    for (const f of faces) {
      frame(surface, f, centre, normal);
      const lift = ABOVE * this.radius;
      const [x, y, z] = [centre[0] + lift * normal[0], centre[1] + lift * normal[1], centre[2] + lift * normal[2]];
      for (let r = 0; r < roots; r++) {
        const i = 3 * (roots * f + r);
        const own = size(vectors, i);
        // Short vectors stay visible: what matters here is the direction.
        const s = own > 0 ? (length * (0.35 + 0.65 * Math.sqrt(own / (most || 1)))) / own : 0;
        const dx = s * vectors[i], dy = s * vectors[i + 1], dz = s * vectors[i + 2];
        if (roots > 1) {
          put(x, y, z);
          put(x + 0.5 * dx, y + 0.5 * dy, z + 0.5 * dz);
          continue;
        }
        const tip = [x + 0.5 * dx, y + 0.5 * dy, z + 0.5 * dz];
        put(x - 0.5 * dx, y - 0.5 * dy, z - 0.5 * dz);
        put(tip[0], tip[1], tip[2]);
        const sx = normal[1] * dz - normal[2] * dy, sy = normal[2] * dx - normal[0] * dz, sz = normal[0] * dy - normal[1] * dx;
        for (const side of [0.16, -0.16]) {
          put(tip[0], tip[1], tip[2]);
          put(tip[0] - 0.28 * dx + side * sx, tip[1] - 0.28 * dy + side * sy, tip[2] - 0.28 * dz + side * sz);
        }
      }
    }
    (this.geometry.getAttribute("position") as BufferAttribute).needsUpdate = true;
    (this.geometry.getAttribute("color") as BufferAttribute).needsUpdate = true;
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
