// A functional map between two surfaces, and what is made of it: carried functions, and files.

import { get, type Mesh } from "./api";
import type { components } from "./openapi";
import type { Surface } from "./surface";

export type FunctionalMap = components["schemas"]["FunctionalMapAnswer"];

/** For each vertex of the target the value at the vertex of the source that it corresponds to; `columns` of them side by side. */
export function carried(points: FunctionalMap["points"], values: Float32Array, columns = 1): Float32Array {
  const out = new Float32Array(columns * points.length);
  points.forEach((point, v) => {
    for (let k = 0; k < columns; k++) out[columns * v + k] = point === null ? NaN : values[columns * point + k];
  });
  return out;
}

/** Colours by place: each coordinate of a vertex as a part of the extent of the surface. */
export function placeColours({ positions: p }: Surface): Float32Array {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < p.length; i++) {
    low[i % 3] = Math.min(low[i % 3], p[i]);
    high[i % 3] = Math.max(high[i % 3], p[i]);
  }
  // One scale for all axes, so that checks are cubes.
  const most = Math.max(...low.map((value, k) => high[k] - value)) || 1;
  return Float32Array.from(p, (value, i) => 0.5 + (value - (low[i % 3] + high[i % 3]) / 2) / most);
}

/** For each vertex of the source the mean confidence of those that were matched with it; where there are none, that of its neighbours. */
export function gathered({ points, confidences }: FunctionalMap, { positions, triangles: t }: Surface): Float32Array {
  const vertices = positions.length / 3;
  let sums = new Float32Array(vertices), counts = new Float32Array(vertices);
  points.forEach((point, v) => {
    if (point === null) return;
    sums[point] += confidences[v] ?? 0;
    counts[point] += 1;
  });
  const values = sums.map((sum, v) => (counts[v] ? sum / counts[v] : NaN));
  // A finer source has vertices between those that were matched; what is far from all of them stays at 0.
  for (let sweep = 0; sweep < 12; sweep++) {
    [sums, counts] = [new Float32Array(vertices), new Float32Array(vertices)];
    for (let i = 0; i < t.length; i++) {
      const [a, b] = [t[i], t[i % 3 === 2 ? i - 2 : i + 1]];
      for (const [to, from] of [[a, b], [b, a]]) {
        if (!Number.isNaN(values[to]) || Number.isNaN(values[from])) continue;
        sums[to] += values[from];
        counts[to] += 1;
      }
    }
    for (let v = 0; v < vertices; v++) if (counts[v]) values[v] = sums[v] / counts[v];
  }
  return values.map((value) => (Number.isNaN(value) ? 0 : value));
}

/** A correspondence as numbers: −1 where a vertex has none. */
export interface Pairs {
  points: Int32Array;
  confidences: Float32Array;
}

interface VertexMap {
  map: (number | null)[];
}

/** The correspondence in the numbering of the kept meshes, or with `file` in that of the files that were uploaded. */
export async function numberedPairs({ points, confidences }: FunctionalMap, source: Mesh, target: Mesh, file: boolean): Promise<Pairs> {
  if (!file) return { points: Int32Array.from(points, (point) => point ?? -1), confidences: Float32Array.from(confidences, (value) => value ?? NaN) };
  const numbers = (mesh: Mesh, of: string) => get<VertexMap>(`/v1/meshes/${mesh.id}/vertex-map?of=${of}`).then(({ map }) => map);
  const [rows, names] = await Promise.all([numbers(target, "file"), numbers(source, "kept")]);
  return {
    points: Int32Array.from(rows, (kept) => (kept === null || points[kept] === null ? -1 : (names[points[kept]!] ?? -1))),
    confidences: Float32Array.from(rows, (kept) => (kept === null ? NaN : (confidences[kept] ?? NaN))),
  };
}
