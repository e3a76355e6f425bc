// Which way is up: files do not say it, and half of them mean z.

import type { Surface } from "./surface";

export type Up = "y" | "z" | "x" | "-y" | "-z" | "-x";

/** For the axes of the screen (to the right, up, to the viewer) the axis of the mesh, and its sign: a rotation for each way up. */
export const AXES: Record<Up, [axis: number, sign: number][]> = {
  y: [[0, 1], [1, 1], [2, 1]],
  z: [[0, 1], [2, 1], [1, -1]],
  x: [[1, -1], [0, 1], [2, 1]],
  "-y": [[0, 1], [1, -1], [2, -1]],
  "-z": [[0, 1], [2, -1], [1, 1]],
  "-x": [[1, 1], [0, -1], [2, 1]],
};

/** Ways up to choose from, with their names. */
export const UPWARD = (Object.keys(AXES) as Up[]).map((up): [Up, string] => [up, `${up.replace("-", "−")} is up`]);

/** The part of the height that counts as touching the ground. */
const FOOT = 0.05;

/**
 * Whether y or z is up. An object stands if its centre of gravity lies over the hull of what touches the ground; of two ways to stand the one
 * with the larger ground under it is taken. Flat meshes face the viewer.
 */
export function guess({ positions: p, triangles: t }: Surface): Up {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < p.length; i++) {
    low[i % 3] = Math.min(low[i % 3], p[i]);
    high[i % 3] = Math.max(high[i % 3], p[i]);
  }
  const size = low.map((value, k) => high[k] - value);
  if (Math.min(size[1], size[2]) < FOOT * Math.max(...size)) return "y";
  const centre = [0, 0, 0];
  let area = 0;
  for (let f = 0; f < t.length; f += 3) {
    const [a, b, c] = [3 * t[f], 3 * t[f + 1], 3 * t[f + 2]];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const own = Math.sqrt((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2);
    for (let k = 0; k < 3; k++) centre[k] += (own * (p[a + k] + p[b + k] + p[c + k])) / 3;
    area += own;
  }
  if (!(area > 0)) return "y";
  const ground = (up: number) => {
    const [i, j] = [0, 1, 2].filter((k) => k !== up);
    const foot: [number, number][] = [];
    for (let v = 0; v < p.length; v += 3) if (p[v + up] < low[up] + FOOT * size[up]) foot.push([p[v + i], p[v + j]]);
    const around = hull(foot);
    return holds(around, centre[i] / area, centre[j] / area) ? extent(around) / (size[i] * size[j] || 1) : 0;
  };
  return ground(2) > ground(1) ? "z" : "y";
}

const turn = ([ax, ay]: number[], [bx, by]: number[], [cx, cy]: number[]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);

/** The convex hull of points in the plane, counter-clockwise (Andrew 1979). */
function hull(points: [number, number][]): [number, number][] {
  const sorted = points.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list: [number, number][]) => {
    const chain: [number, number][] = [];
    for (const point of list) {
      while (chain.length > 1 && turn(chain[chain.length - 2], chain[chain.length - 1], point) <= 0) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.slice().reverse())];
}

const holds = (around: [number, number][], x: number, y: number) =>
  around.length > 2 && around.every((point, k) => turn(point, around[(k + 1) % around.length], [x, y]) > 0);

const extent = (around: [number, number][]) =>
  0.5 * around.reduce((sum, [x, y], k) => sum + x * around[(k + 1) % around.length][1] - y * around[(k + 1) % around.length][0], 0);
