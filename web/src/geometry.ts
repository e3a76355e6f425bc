// What a mesh needs before it is drawn, in a thread of its own where it takes long: normals, size, coarser levels.

import { bounds, normals, volume, type Surface } from "./surface";
import { guess, type Up } from "./upright";

/** A surface as it is drawn. Levels are lists of corners over the same vertices, the first of them the mesh itself. */
export interface Prepared extends Surface {
  normals: Float32Array;
  centre: [number, number, number];
  radius: number;
  /** Six times the volume that is enclosed. */
  volume: number;
  /** Which way is up, as far as can be guessed. */
  up: Up;
  levels: Uint32Array[];
}

/** Triangles of the coarser levels, about. */
const LEVELS = [40_000, 12_000];

/** Reads the content of a mesh as the server sends it, and prepares it. */
export function prepare(content: ArrayBuffer): Prepared {
  const [vertices, faces] = new Uint32Array(content, 0, 2);
  const surface = { positions: new Float32Array(content, 8, 3 * vertices), triangles: new Uint32Array(content, 8 + 12 * vertices, 3 * faces) };
  const { centre, radius } = bounds(surface);
  const facing = normals(surface);
  const levels: Uint32Array[] = [surface.triangles];
  for (const most of LEVELS) if (faces > 1.5 * most) levels.push(coarser(surface, facing, most));
  return { ...surface, normals: facing, centre, radius, volume: volume(surface), up: guess(surface), levels };
}

/**
 * About so many triangles that stand for all of them while things move: vertices in one cell of a grid and with one main direction
 * become one of them (Rossignac and Borrel 1993), so that whatever is known at the vertices can be shown at once.
 */
export function coarser({ positions: p, triangles: t }: Surface, facing: Float32Array, most: number): Uint32Array {
  let area = 0;
  for (let f = 0; f < t.length; f += 3) {
    const a = 3 * t[f], b = 3 * t[f + 1], c = 3 * t[f + 2];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    area += 0.5 * Math.sqrt(x * x + y * y + z * z);
  }
  // Two triangles for each cell that the surface meets; it meets about one and a half for each of its size.
  const cell = Math.sqrt((3 * area) / most) || 1;
  const count = p.length / 3;
  const chosen = new Uint32Array(count);
  const first = new Map<number, number>();
  for (let v = 0; v < count; v++) {
    const i = 3 * v;
    const x = Math.abs(facing[i]), y = Math.abs(facing[i + 1]), z = Math.abs(facing[i + 2]);
    const axis = x > y ? (x > z ? 0 : 2) : y > z ? 1 : 2;
    const side = 2 * axis + (facing[i + axis] > 0 ? 1 : 0);
    const key = ((Math.floor(p[i] / cell) & 0x7fff) * 0x8000 + (Math.floor(p[i + 1] / cell) & 0x7fff)) * 0x40000 + (Math.floor(p[i + 2] / cell) & 0x7fff) * 8 + side;
    const known = first.get(key);
    if (known === undefined) first.set(key, v);
    chosen[v] = known ?? v;
  }
  const kept = new Uint32Array(t.length);
  let at = 0;
  for (let f = 0; f < t.length; f += 3) {
    const a = chosen[t[f]], b = chosen[t[f + 1]], c = chosen[t[f + 2]];
    if (a === b || b === c || a === c) continue;
    kept[at] = a;
    kept[at + 1] = b;
    kept[at + 2] = c;
    at += 3;
  }
  return kept.slice(0, at);
}

/** Vertices from which on a thread of its own is worth its start. */
const OWN_THREAD = 20_000;

/** Prepares a mesh without keeping the page from answering. */
export async function prepared(content: ArrayBuffer): Promise<Prepared> {
  if (new Uint32Array(content, 0, 1)[0] < OWN_THREAD) return prepare(content);
  const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  try {
    return await new Promise<Prepared>((resolve, reject) => {
      worker.onmessage = (event: MessageEvent<Prepared>) => resolve(event.data);
      worker.onerror = (event) => reject(new Error(event.message || "the mesh could not be prepared"));
      worker.postMessage(content, [content]);
    });
  } finally {
    worker.terminate();
  }
}
