// How values become colours, the same for every tab: colour map, isolines, range, and a legend that tells what colours mean.

import type { App } from "../app";
import { MAPS, gradient, table } from "../colours";
import { brief, choice, field, grouped, h, slider } from "../dom";
import { Plot, type Frame } from "../plot";
import { PLAIN } from "../shading";
import type { Scalar } from "../viewer";

/** Bars of the histogram. */
const BARS = 44;

export class Look {
  readonly element: HTMLElement;
  readonly legend: HTMLElement;
  private readonly ramp = h("span", { class: "ramp" });
  private readonly labels = h("div", { class: "labels" }, h("span", {}), h("span", {}), h("span", {}));
  private readonly plot: Plot;
  private scalar: Scalar | null = null;
  private name = { diverging: "blue-orange", sequential: "viridis" };
  /** Ends of the range that were typed in; what is not a number follows the values. */
  private wanted: [number, number] = [NaN, NaN];
  private readonly inputs: HTMLInputElement[];
  private counts: number[] = [];
  private marked: number | null = null;

  constructor(private readonly app: App) {
    this.plot = new Plot(34, "Histogram of the values at the vertices", (frame) => bars(frame, this.counts, this.part(this.marked)));
    this.plot.canvas.classList.add("histogram");
    this.legend = h("div", { class: "legend", hidden: true }, this.plot.canvas, this.ramp, this.labels);
    const maps = choice([], "", () => {}, "Colours");
    const lines = slider("Isolines", { min: 0, max: 40, step: 1, value: app.place.lines ?? 16 }, (value) => {
      app.go({ lines: value });
      app.viewer.lines(value);
      app.emit("map");
    }, (value) => (value ? String(value) : "none"));
    const arrive = () => {
      const wanted = MAPS[app.place.map ?? ""];
      if (wanted) this.name[wanted.diverging ? "diverging" : "sequential"] = app.place.map!;
      lines.set(app.place.lines ?? 16);
      app.viewer.lines(app.place.lines ?? 16);
      this.apply();
    };
    maps.addEventListener("change", () => {
      this.name[MAPS[maps.value].diverging ? "diverging" : "sequential"] = maps.value;
      app.go({ map: maps.value });
      this.apply();
    });
    const end = (index: 0 | 1, label: string) => {
      const input = h("input", { type: "number", step: "any", "aria-label": label, placeholder: index ? "largest" : "least" });
      input.addEventListener("change", () => {
        this.wanted[index] = input.value === "" ? NaN : input.valueAsNumber;
        // Ends in the wrong order change places.
        if (this.wanted[0] > this.wanted[1]) {
          this.wanted.reverse();
          this.inputs.forEach((input, k) => (input.value = String(this.wanted[k])));
        }
        if (this.scalar) this.show(this.scalar, this.ends);
        for (const input of this.inputs) input.reportValidity();
        app.emit("map");
      });
      return input;
    };
    this.inputs = [end(0, "Colours begin at"), end(1, "Colours end at")];
    this.element = h("div", { class: "look" }, field("Colours", maps), lines.element, h("div", { class: "field" }, h("span", {}, "Range"), h("div", { class: "row ends" }, ...this.inputs)));
    this.options = (diverging) => {
      maps.replaceChildren(...Object.entries(MAPS).filter(([, map]) => map.diverging === diverging).map(([key, map]) => h("option", { value: key }, map.name)));
      maps.value = this.name[diverging ? "diverging" : "sequential"];
    };
    app.on("look", arrive);
    const forget = () => {
      this.wanted = [NaN, NaN];
      for (const input of this.inputs) {
        input.value = "";
        input.setCustomValidity("");
      }
    };
    app.on("mesh", forget);
    // Another tab shows something else, in another unit.
    let tab = app.panel;
    app.on("tab", () => {
      if (app.panel !== tab) forget();
      tab = app.panel;
    });
    arrive();
  }

  private readonly options: (diverging: boolean) => void;
  private ends: [string, string] | undefined;

  /** Colours the surface; `null` leaves it plain. With `ends`, words stand in place of numbers. */
  show(scalar: Scalar | null, ends?: [string, string]) {
    this.scalar = scalar;
    this.ends = ends;
    this.marked = null;
    if (!scalar) {
      this.legend.hidden = true;
      return this.app.viewer.setScalar(null);
    }
    const range = this.range!;
    this.judge(scalar.range);
    this.app.viewer.setScalar({ ...scalar, range });
    this.legend.hidden = false;
    // What words describe changes from picture to picture, and numbers would be of no use.
    this.plot.canvas.hidden = ends !== undefined;
    const texts = ends ? [ends[0], "", ends[1]] : [range[0], (range[0] + range[1]) / 2, range[1]].map(brief);
    texts.forEach((text, k) => (this.labels.children[k].textContent = text));
    if (!ends) {
      this.counts = count(scalar.values, range);
      this.plot.canvas.setAttribute("aria-label", `Histogram of ${grouped(scalar.values.length)} values from ${brief(range[0])} to ${brief(range[1])}`);
      this.plot.draw();
    }
    this.apply();
  }

  /** Says at an end that was typed in whether it leaves nothing between itself and the other one: the values' own range is shown then. */
  private judge(range: [number, number]) {
    for (const input of this.inputs) input.setCustomValidity("");
    const typed = this.wanted.findLastIndex((value) => !Number.isNaN(value));
    if (typed < 0 || this.asked) return;
    const other = this.wanted.every((value) => !Number.isNaN(value)) ? this.wanted[0] : range[1 - typed];
    this.inputs[typed].setCustomValidity(`The range must ${typed ? "end above" : "begin below"} ${brief(other)}.`);
  }

  /** What the ends of the colours stand for; null where there are no colours. */
  get range(): [number, number] | null {
    return this.scalar && (this.asked ?? this.scalar.range);
  }

  /** The range that was typed in, with the values' own end where one was not; null where nothing lies in it. */
  private get asked(): [number, number] | null {
    const { range } = this.scalar!;
    const [low, high] = this.wanted.map((end, k) => (Number.isNaN(end) ? range[k] : end));
    return high > low ? [low, high] : null;
  }

  /** Where a value lies between the ends of the colours, from 0 to 1. */
  private part(value: number | null): number | null {
    const range = this.range;
    return value === null || !range ? null : Math.min(Math.max((value - range[0]) / (range[1] - range[0]), 0), 1);
  }

  /** The value that is shown at a vertex; it is marked in the histogram. */
  at(vertex: number | null): number | null {
    const value = vertex === null ? null : (this.scalar?.values[vertex] ?? null);
    if (value !== this.marked && !this.plot.canvas.hidden) {
      this.marked = value;
      this.plot.draw();
    }
    return value;
  }

  /** The values that are shown, one for each vertex. */
  get values(): Float32Array | null {
    return this.scalar?.values ?? null;
  }

  /** The values that are shown, and the colour of each. */
  coloured(): { values: Float32Array; colours: Uint8Array } | null {
    if (!this.scalar) return null;
    const { values, diverging } = this.scalar;
    const [low, high] = this.range!;
    const steps = table(MAPS[this.name[diverging ? "diverging" : "sequential"]], 1024);
    const colours = new Uint8Array(3 * values.length);
    const scale = 1023 / Math.max(high - low, 1e-30);
    const plain = PLAIN.map((part) => Math.round(255 * part));
    for (let v = 0; v < values.length; v++) {
      if (!Number.isFinite(values[v])) {
        colours.set(plain, 3 * v);
        continue;
      }
      const at = 4 * Math.round(Math.min(Math.max((values[v] - low) * scale, 0), 1023));
      for (let k = 0; k < 3; k++) colours[3 * v + k] = steps[at + k];
    }
    return { values, colours };
  }

  private applied = "";

  private apply() {
    const diverging = this.scalar?.diverging ?? true;
    const name = this.name[diverging ? "diverging" : "sequential"];
    if (this.applied === name) return;
    this.applied = name;
    this.options(diverging);
    this.app.viewer.map(name);
    this.ramp.style.background = gradient(MAPS[name]);
    this.app.emit("map");
  }

  /** The colour map in use. */
  get map(): string {
    return this.applied;
  }
}

/** How many values lie in each part of a range; what lies beyond counts with its ends, what is not finite not at all. */
function count(values: Float32Array, [low, high]: [number, number]): number[] {
  const counts = new Array<number>(BARS).fill(0);
  const scale = BARS / (high - low);
  for (const value of values) if (Number.isFinite(value)) counts[Math.min(Math.max(Math.floor((value - low) * scale), 0), BARS - 1)] += 1;
  return counts;
}

function bars({ context: c, width, height, ink, second }: Frame, counts: number[], marked: number | null) {
  const most = Math.max(...counts, 1);
  const wide = width / BARS;
  c.fillStyle = ink;
  c.globalAlpha = 0.55;
  // Roots of the counts: what is rare stays visible beside a peak.
  counts.forEach((number, k) => c.fillRect(k * wide, height - Math.sqrt(number / most) * height, Math.max(wide - 0.7, 0.5), height));
  c.globalAlpha = 1;
  if (marked === null) return;
  c.fillStyle = second;
  c.fillRect(Math.min(marked * width, width - 2), 0, 2, height);
}

/** Values symmetric about zero. */
export function diverging(values: Float32Array): Scalar {
  let most = 0;
  for (const value of values) if (Number.isFinite(value)) most = Math.max(most, Math.abs(value));
  return { values, range: [-most, most], diverging: true };
}

/**
 * Values from the least to the largest, or to a quantile that keeps single peaks from hiding the rest. What is not finite, as a distance to
 * another component, has no part in it.
 */
export function sequential(values: Float32Array, quantile = 1): Scalar {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (low > high) [low, high] = [0, 1];
  if (quantile < 1) {
    const finite = values.filter(Number.isFinite).sort();
    high = finite[Math.floor(quantile * (finite.length - 1))] ?? high;
  }
  return { values, range: [low, high > low ? high : low + 1], diverging: false };
}
