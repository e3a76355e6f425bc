// A matrix as a picture.

import type { Frame } from "../plot";

/** Entries as squares: blue below zero, orange above, clear where there is nothing. */
export function paintMatrix({ context: c, width, height, faint, accent, second }: Frame, { columns = 1, values }: { columns?: number; values: number[] }) {
  const rows = Math.floor(values.length / columns);
  const cell = Math.min(width / columns, height / rows);
  // Few entries are much larger than the rest: the scale is that of the diagonal.
  const sizes = values.map(Math.abs).sort((a, b) => a - b);
  const most = Math.max(sizes[Math.floor(0.995 * (sizes.length - 1))], 1e-30);
  c.strokeStyle = faint;
  c.strokeRect(0.5, 0.5, cell * columns - 1, cell * rows - 1);
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < columns; j++) {
      const value = values[i * columns + j];
      const part = Math.min(Math.abs(value) / most, 1);
      if (part < 0.03) continue;
      c.globalAlpha = part;
      c.fillStyle = value < 0 ? accent : second;
      c.fillRect(j * cell, i * cell, Math.ceil(cell * 2) / 2, Math.ceil(cell * 2) / 2);
    }
  }
  c.globalAlpha = 1;
}
