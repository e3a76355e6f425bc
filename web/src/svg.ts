// Lines as a drawing.

import { Lines } from "./text";

/** Lines in the plane as a picture of vectors, for print and plotters. */
export function svg(lines: [x: number, y: number][][], width: number, height: number, stroke: number): Blob {
  const text = new Lines();
  text.add(`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" fill="none" stroke="#14325c" stroke-width="${stroke.toFixed(2)}" stroke-linecap="round" stroke-linejoin="round">`);
  for (const line of lines) text.add(`<path d="M${line.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}"/>`);
  text.add("</svg>");
  return text.blob("image/svg+xml");
}
