// What holds a vibrating object: a slab at one of its ends, and whatever is painted by hand.

import type { App } from "../app";
import { choice, field, h, plural, slider } from "../dom";
import { dots } from "../lines";
import type { Hit } from "../surface";
import { AXES } from "../upright";

/** Axes are those of the screen. */
const SLABS: [string, string, axis: number, low: boolean][] = [
  ["bottom", "at the bottom", 1, true], ["top", "at the top", 1, false], ["left", "on the left", 0, true], ["right", "on the right", 0, false],
  ["back", "at the back", 2, true], ["front", "in front", 2, false],
];
/** Dots that show what is held. */
const SHOWN = 1500;
const COLOUR = 0x7b1fa2;

export class Clamp {
  readonly element: HTMLElement;
  private painted = new Set<number>();
  private erasing = false;
  private readonly where = choice([["none", "nothing: free"], ...SLABS.map(([key, name]): [string, string] => [key, name]), ["brush", "a painted region"]], "none", () => this.update());
  private readonly part = slider("Part", { min: 0.01, max: 0.5, step: 0.01, value: 0.05 }, () => this.update(), (value) => `${Math.round(100 * value)} %`);
  private readonly brush = slider("Brush", { min: 0.02, max: 0.3, step: 0.01, value: 0.08 }, () => {}, (value) => `${Math.round(100 * value)} %`);
  private readonly note = h("p", { class: "dim", "aria-live": "polite" });
  private readonly tools: HTMLElement;

  constructor(private readonly app: App, private readonly changed: () => void) {
    const rub = h("button", { type: "button", "aria-pressed": "false", onclick: () => {
      this.erasing = !this.erasing;
      rub.setAttribute("aria-pressed", String(this.erasing));
    } }, "Erase");
    this.tools = h("div", {}, h("p", {}, "Paint the region to clamp on the surface; drag beside it to turn the view."), this.brush.element,
      h("div", { class: "row" }, rub, h("button", { type: "button", onclick: () => { this.painted.clear(); this.update(); } }, "Clear")));
    this.element = h("div", {}, field("Clamped", this.where), this.part.element, this.tools, this.note);
    app.on("look", () => this.update());
    app.on("mesh", () => {
      this.painted.clear();
      this.where.value = "none";
      this.update();
    });
    this.update();
  }

  /** Whether pointer and cursor paint. */
  get painting(): boolean {
    return this.where.value === "brush";
  }

  /** The vertices that are held, in order. */
  get vertices(): number[] {
    if (this.painting) return [...this.painted].sort((a, b) => a - b);
    const slab = SLABS.find(([key]) => key === this.where.value);
    const p = this.app.viewer.resting;
    if (!slab || !p) return [];
    const [axis, sign] = AXES[this.app.viewer.up][slab[2]];
    const atLow = slab[3] === sign > 0;
    let [low, high] = [Infinity, -Infinity];
    for (let i = axis; i < p.length; i += 3) {
      low = Math.min(low, p[i]);
      high = Math.max(high, p[i]);
    }
    const depth = this.part.control.valueAsNumber * (high - low);
    const found: number[] = [];
    for (let v = 0; 3 * v < p.length; v++) if (atLow ? p[3 * v + axis] <= low + depth : p[3 * v + axis] >= high - depth) found.push(v);
    return found;
  }

  /** A touch of the brush. */
  readonly paint = (hit: Hit): boolean => {
    const p = this.app.viewer.resting;
    if (!p) return false;
    const reach = (this.brush.control.valueAsNumber * this.app.viewer.radius) ** 2;
    const [x, y, z] = hit.point;
    for (let v = 0; 3 * v < p.length; v++) {
      if ((p[3 * v] - x) ** 2 + (p[3 * v + 1] - y) ** 2 + (p[3 * v + 2] - z) ** 2 > reach) continue;
      if (this.erasing) this.painted.delete(v);
      else this.painted.add(v);
    }
    // A brush smaller than the triangles still takes what it touches.
    if (!this.erasing) this.painted.add(hit.vertex);
    this.update();
    return true;
  };

  private update() {
    this.part.element.hidden = this.where.value === "none" || this.painting;
    this.tools.hidden = !this.painting;
    const held = this.vertices;
    this.note.textContent = this.where.value === "none" ? "" : held.length ? `${plural(held.length, "vertex", "vertices")} clamped.` : "Nothing is clamped yet.";
    this.changed();
  }
}

/** Shows which vertices are held. */
export function showHeld(app: App, vertices: number[]) {
  const p = app.viewer.resting;
  if (!p || vertices.length === 0) return app.viewer.overlay("held", null);
  const every = Math.max(1, Math.ceil(vertices.length / SHOWN));
  app.viewer.overlay("held", dots(vertices.filter((_, i) => i % every === 0).map((v) => [p[3 * v], p[3 * v + 1], p[3 * v + 2], COLOUR]), 0.011 * app.viewer.radius));
}
