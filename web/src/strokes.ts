// What is drawn on a surface by hand, packed for an address: whole thousandths of its radius around its centre.

import type { Viewer } from "./viewer";

const STEPS = 1000;

type Frame = Pick<Viewer, "centre" | "radius">;

/** Points one after the other, three whole numbers each. */
export const packed = ({ centre, radius }: Frame, points: number[][]): number[] => points.flatMap((point) => point.map((x, k) => Math.round((STEPS * (x - centre[k])) / radius)));

/** The points again; of what makes no sense, none. */
export function unpacked({ centre, radius }: Frame, numbers: unknown): number[][] {
  if (!Array.isArray(numbers) || numbers.length % 3 !== 0 || !numbers.every((x) => typeof x === "number" && Math.abs(x) < 1e5)) return [];
  return Array.from({ length: numbers.length / 3 }, (_, i) => [0, 1, 2].map((k) => centre[k] + (numbers[3 * i + k] * radius) / STEPS));
}
