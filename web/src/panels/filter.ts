// The spectral filter: a curve over the modes is drawn by hand, and the surface follows.

import { postNumbers, recent, type Basis } from "../api";
import type { App, Panel } from "../app";
import { brief, choice, field, grouped, h, slider } from "../dom";
import { latest } from "../latest";
import { Plot, type Frame } from "../plot";
import { basisHead, eigenForm, ofFunctions } from "./basis";
import { compression } from "./compress";
import type { Look } from "./look";

/** Points of the curve. */
const POINTS = 97;
/** The largest factor. */
const MOST = 3;
const LEFT = 30, RIGHT = 8, TOP = 8, BOTTOM = 26;

/** What an address keeps: the curve in hundredths, the rest, and what is done. */
interface State {
  curve: number[];
  beyond: number;
  only: number;
  what: string;
  pairs: number;
  bits: number;
}

export function filterPanel(app: App, look: Look): Panel {
  const head = basisHead(app, () => panel, "basis", eigenForm(app, look));
  const body = h("div", { hidden: true });
  const timing = h("p", { class: "dim", "aria-live": "off" });
  const curve = new Float32Array(POINTS).fill(1);
  let cursor = 8;
  let beyond = 1;
  /** Only so many modes are kept; 0 for all, and what lies beyond them. */
  let only = 0;
  let what = "curve";

  const here = (basis: Basis) => app.basis === basis && app.panel === panel;
  const keep = () => {
    const state: State = { curve: Array.from(curve, (value) => Math.round(100 * value)), beyond, only, what, pairs: packing.pairs.control.valueAsNumber, bits: packing.bits.control.valueAsNumber };
    app.keep(what === "curve" && unchanged() ? null : state);
  };
  const unchanged = () => only === 0 && beyond === 1 && curve.every((value) => value === 1);
  const packing = compression(app, (basis) => here(basis) && what === "compression", () => keep());
  const send = latest<{ basis: Basis; values: number[]; beyond: number }>(async ({ basis, values, beyond }) => {
    const begin = performance.now();
    const positions = await postNumbers(`${basis.links.self}/filter`, { functions: "coordinates", transfer: { kind: "samples", values, beyond } });
    // Meanwhile the curve may have been set back, which asks for nothing.
    if (!here(basis) || what !== "curve" || unchanged()) return;
    app.viewer.setPositions(positions);
    timing.textContent = `${brief(performance.now() - begin)} ms for the answer`;
    document.body.dataset.filtered = String(Number(document.body.dataset.filtered ?? 0) + 1);
  }, app.fail);

  const apply = () => {
    plot.draw();
    const basis = app.basis;
    curved.hidden = what !== "curve";
    packing.element.hidden = what !== "compression";
    if (!basis) return;
    keep();
    if (what === "compression") return packing.apply();
    if (unchanged()) {
      app.viewer.setPositions(null);
      recent.shown = null;
      timing.textContent = "Nothing is changed yet: draw on the curve.";
      return;
    }
    const m = basis.count;
    const values = Array.from({ length: m }, (_, k) => {
      const t = (k / Math.max(m - 1, 1)) * (POINTS - 1);
      const i = Math.min(Math.floor(t), POINTS - 2);
      if (only > 0 && k >= only) return 0;
      return Number((curve[i] + (t - i) * (curve[i + 1] - curve[i])).toFixed(4));
    });
    send({ basis, values, beyond: only > 0 ? 0 : beyond });
  };
  const preset = (name: string, factor: (t: number) => number, rest: number) =>
    h("button", { onclick: () => {
      for (let i = 0; i < POINTS; i++) curve[i] = factor(i / (POINTS - 1));
      beyond = rest;
      only = 0;
      first.set(0);
      detail.value = String(rest);
      apply();
    } }, name);

  const plot = new Plot(210, "The factor of each mode. Draw with the pointer, or move the marked point with the arrow keys.", (frame) => paint(frame, curve, cursor));
  plot.canvas.tabIndex = 0;
  plot.canvas.classList.add("drawing");
  plot.canvas.setAttribute("role", "application");
  let before: [number, number] | null = null;
  const draw = (event: PointerEvent) => {
    const [x, y] = plot.at(event);
    const { clientWidth: width, clientHeight: height } = plot.canvas;
    const at = Math.min(Math.max(((x - LEFT) / (width - LEFT - RIGHT)) * (POINTS - 1), 0), POINTS - 1);
    let value = MOST * Math.min(Math.max((height - BOTTOM - y) / (height - TOP - BOTTOM), 0), 1);
    if (Math.abs(value - 1) < 0.06) value = 1;
    const [from, start] = before ?? [at, value];
    const [low, high] = [Math.min(from, at), Math.max(from, at)];
    for (let i = Math.ceil(low - 0.5); i <= Math.floor(high + 0.5); i++) {
      const t = at === from ? 1 : Math.min(Math.max((i - from) / (at - from), 0), 1);
      if (i >= 0 && i < POINTS) curve[i] = start + t * (value - start);
    }
    before = [at, value];
    cursor = Math.round(at);
    apply();
  };
  plot.canvas.addEventListener("pointerdown", (event) => {
    plot.canvas.setPointerCapture(event.pointerId);
    before = null;
    draw(event);
  });
  plot.canvas.addEventListener("pointermove", (event) => event.buttons && draw(event));
  plot.canvas.addEventListener("keydown", (event) => {
    const { key } = event;
    if (key === "ArrowLeft" || key === "ArrowRight") {
      cursor = Math.min(Math.max(cursor + (key === "ArrowLeft" ? -1 : 1), 0), POINTS - 1);
      plot.draw();
    } else if (key === "ArrowUp" || key === "ArrowDown") {
      // A soft brush: single points would only ring.
      for (let i = 0; i < POINTS; i++) {
        const weight = Math.exp(-(((i - cursor) / 4) ** 2));
        curve[i] = Math.min(Math.max(curve[i] + weight * (key === "ArrowUp" ? 0.15 : -0.15), 0), MOST);
      }
      apply();
    } else return;
    event.preventDefault();
  });
  const detail = h("input", { type: "range", min: "0", max: String(MOST), step: "0.05", value: "1", "aria-label": "Detail beyond the basis" });
  detail.addEventListener("input", () => {
    beyond = detail.valueAsNumber;
    apply();
  });

  const first = slider("First modes", { min: 0, max: 100, step: 1, value: 0 }, (value) => {
    only = value;
    apply();
  }, (value) => (value ? grouped(value) : "all"));
  const kinds = choice([["curve", "a curve over the modes"], ["compression", "compression"]], what, (value) => {
    what = value;
    apply();
  });
  const curved = h("div", {},
    h("p", {}, "Each mode is multiplied by the curve. Draw it: down smooths, up exaggerates."), plot.canvas,
    h("label", { class: "field slider" }, h("span", {}, "Fine detail"), detail),
    h("div", { class: "row wrap" },
      preset("Original", () => 1, 1),
      preset("Smooth", (t) => Math.exp(-((t / 0.35) ** 2)), 0),
      preset("Caricature", (t) => 1 + 1.5 * Math.exp(-(((t - 0.3) / 0.12) ** 2)), 1),
      preset("Sharpen", (t) => 1 + 1.4 * t, 2)),
    first.element, timing);
  body.append(field("Filter", kinds), curved, packing.element);

  const panel: Panel = {
    id: "filter",
    title: "Filter",
    about: "Reshape the surface by its frequencies: smooth it, or exaggerate what is typical of it.",
    guide: "filtering",
    kind: "eigenbasis",
    fits: ofFunctions,
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      body.hidden = app.basis === null;
      app.title.textContent = app.mesh?.name ?? "";
      look.show(null);
      if (app.basis) {
        const state = app.arrived<Partial<State>>("filter");
        if (state) adopt(state);
        packing.pairs.control.max = first.control.max = String(app.basis.count);
        packing.pairs.set(Math.min(packing.pairs.control.valueAsNumber, app.basis.count));
        only = Math.min(only, app.basis.count);
        first.set(only);
      }
      apply();
    },
    hide() {
      app.viewer.setPositions(null);
      delete document.body.dataset.compressed;
    },
  };
  /** Takes over what an address says, as far as it makes sense. */
  const adopt = ({ curve: values, beyond: rest, only: most, what: wanted, pairs, bits }: Partial<State>) => {
    const number = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);
    if (Array.isArray(values) && values.length === POINTS && values.every(number)) values.forEach((value, i) => (curve[i] = Math.min(Math.max(value / 100, 0), MOST)));
    if (number(rest)) detail.value = String((beyond = Math.min(Math.max(rest, 0), MOST)));
    if (number(most)) only = Math.max(Math.round(most), 0);
    if (wanted === "curve" || wanted === "compression") kinds.value = what = wanted;
    if (number(pairs)) {
      packing.pairs.control.max = String(app.basis?.count ?? 100);
      packing.pairs.set(pairs);
    }
    if (number(bits)) packing.bits.set(bits);
  };
  return panel;
}

function paint({ context: c, width, height, ink, faint, accent }: Frame, curve: Float32Array, cursor: number) {
  const x = (i: number) => LEFT + ((width - LEFT - RIGHT) * i) / (POINTS - 1);
  const y = (value: number) => height - BOTTOM - ((height - TOP - BOTTOM) * value) / MOST;
  c.fillStyle = ink;
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (let value = 0; value <= MOST; value++) {
    c.strokeStyle = value === 1 ? ink : faint;
    c.globalAlpha = value === 1 ? 0.45 : 1;
    c.beginPath();
    c.moveTo(LEFT, y(value));
    c.lineTo(width - RIGHT, y(value));
    c.stroke();
    c.globalAlpha = 1;
    c.fillText(`×${value}`, LEFT - 6, y(value));
  }
  c.beginPath();
  c.moveTo(x(0), y(0));
  curve.forEach((value, i) => c.lineTo(x(i), y(value)));
  c.lineTo(x(POINTS - 1), y(0));
  c.fillStyle = accent;
  c.globalAlpha = 0.16;
  c.fill();
  c.globalAlpha = 1;
  c.beginPath();
  curve.forEach((value, i) => c.lineTo(x(i), y(value)));
  c.strokeStyle = accent;
  c.lineWidth = 2;
  c.stroke();
  c.beginPath();
  c.arc(x(cursor), y(curve[cursor]), 4.5, 0, 7);
  c.fillStyle = accent;
  c.fill();
  c.fillStyle = ink;
  c.textAlign = "left";
  c.fillText("coarse shape", LEFT, height - 10);
  c.textAlign = "right";
  c.fillText("fine shape", width - RIGHT, height - 10);
}
