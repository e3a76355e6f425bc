// A family of operators: t and v under sliders, and spectrum and eigenfunctions follow.

import { send, type Basis } from "../api";
import type { App, Panel } from "../app";
import { brief, field, grouped, h, slider } from "../dom";
import { latest } from "../latest";
import { Plot, ticks, type Frame } from "../plot";
import { basisHead } from "./basis";
import { expected } from "./expected";
import { diverging, type Look } from "./look";

interface Wish {
  basis: Basis;
  extrinsic: number;
  curvature: number;
  mode: number;
}

/** What an address keeps: where the sliders stand. */
interface State {
  extrinsic: number;
  strength: number;
}

/** Eigenvalues that the plot shows. */
const SHOWN = 60;

export function familyPanel(app: App, look: Look): Panel {
  const head = basisHead(app, () => panel, "family", form(app));
  const body = h("div", { hidden: true });
  const timing = h("p", { class: "dim" });
  const facts = h("p", { class: "facts" });
  let values: number[] = [];
  let before: Float32Array | null = null;
  let plain: number[] = [];

  const ask = latest<Wish>(async ({ basis, extrinsic, curvature, mode }) => {
    const begin = performance.now();
    const response = await send(`${basis.links.self}/spectrum`, {
      method: "POST",
      headers: { "Content-Type": "application/json", Accept: "application/octet-stream" },
      body: JSON.stringify({ extrinsic, curvature, count: Math.min(SHOWN, basis.count), give: "modes", mode }),
    });
    const shown = new Float32Array(await response.arrayBuffer());
    if (app.basis !== basis || app.panel !== panel) return;
    values = (response.headers.get("Chladni-Eigenvalues") ?? "").split(" ").map(Number);
    if (extrinsic === 0 && curvature === 0) plain = values;
    // An eigenfunction has no sign of its own: the one nearer to what was seen before.
    if (before?.length === shown.length) {
      let product = 0;
      for (let v = 0; v < shown.length; v++) product += shown[v] * before[v];
      if (product < 0) for (let v = 0; v < shown.length; v++) shown[v] = -shown[v];
    }
    before = shown;
    look.show(diverging(shown));
    facts.replaceChildren(h("b", {}, `λ = ${brief(values[mode])}`), h("span", { class: "dim" }, `mode ${grouped(mode)}`));
    timing.textContent = `${brief(performance.now() - begin)} ms for ${grouped(values.length)} pairs of another operator`;
    plot.draw();
    document.body.dataset.family = `${extrinsic} ${curvature} ${mode}`;
  }, app.fail);
  const update = () => {
    const basis = app.basis;
    if (!basis) return;
    const strength = potential.control.valueAsNumber;
    app.keep({ extrinsic: t.control.valueAsNumber, strength } satisfies State);
    ask({ basis, extrinsic: t.control.valueAsNumber, curvature: strength > 0 ? 10 ** (strength - 3) : 0, mode: mode.control.valueAsNumber });
  };
  const t = slider("Extrinsic t", { min: 0, max: 1, step: 0.01, value: 0 }, update, (value) => value.toFixed(2), "0 is the Laplacian, which bending does not change; 1 sees how the surface lies in space");
  const potential = slider("Curvature", { min: 0, max: 4, step: 0.1, value: 0 }, update, (value) => (value ? brief(10 ** (value - 3)) : "0"), "The potential of curvature: eigenfunctions avoid places that are bent much");
  const mode = slider("Mode", { min: 0, max: SHOWN - 1, step: 1, value: 5 }, (value) => {
    app.go({ mode: value });
    before = null;
    update();
  });
  const plot = new Plot(170, "Eigenvalues of the operator, and in grey those of the Laplacian", (frame) => paint(frame, values, plain, mode.control.valueAsNumber));
  body.append(h("p", {}, "(1 − t) Laplacian + t extrinsic + curvature potential, solved again in one space for every move."),
    t.element, potential.element, mode.element, facts, plot.canvas, timing);

  const panel: Panel = {
    id: "family",
    title: "Family",
    about: "Operators between the intrinsic and the extrinsic one, solved again as you move a slider.",
    guide: "operator-families",
    kind: "operator_family",
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      body.hidden = app.basis === null;
      app.title.textContent = app.mesh?.name ?? "";
      if (!app.basis) return look.show(null);
      body.append(look.element);
      const state = app.arrived<Partial<State>>("family");
      if (typeof state?.extrinsic === "number") t.set(state.extrinsic);
      if (typeof state?.strength === "number") potential.set(state.strength);
      // A small space has no more of them than dimensions.
      const most = Math.min(SHOWN, app.basis.count) - 1;
      mode.control.max = String(most);
      mode.set(Math.min(app.place.mode, most));
      [values, plain, before] = [[], [], null];
      update();
    },
    hide() {
      delete document.body.dataset.family;
    },
  };
  return panel;
}

function form(app: App): HTMLElement {
  const dimension = h("input", { type: "number", min: "10", max: "4000", value: "500" });
  const parameters = () => ({ dimension: dimension.valueAsNumber });
  const made = h("form", { class: "form", onsubmit: (event: Event) => {
    event.preventDefault();
    void app.submit("operator_family", parameters());
  } }, field("Dimension", dimension, "Columns of the space"), h("button", { class: "primary" }, "Compute"));
  made.append(expected(app, made, "operator_family", parameters));
  return made;
}

function paint({ context: c, width, height, ink, faint, accent }: Frame, values: number[], plain: number[], mode: number) {
  if (!values.length) return;
  const left = 46, right = 8, top = 8, bottom = height - 8;
  const most = Math.max(values[values.length - 1], plain[plain.length - 1] ?? 0) || 1;
  const x = (k: number) => left + ((width - left - right) * k) / Math.max(values.length - 1, 1);
  const y = (value: number) => bottom - ((bottom - top) * value) / most;
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (const value of ticks(0, most, 3)) {
    c.strokeStyle = faint;
    c.beginPath();
    c.moveTo(left, y(value));
    c.lineTo(width - right, y(value));
    c.stroke();
    c.fillStyle = ink;
    c.fillText(brief(value), left - 5, y(value));
  }
  const points = (list: number[], colour: string) => {
    c.fillStyle = colour;
    list.forEach((value, k) => {
      c.beginPath();
      c.arc(x(k), y(value), 2, 0, 7);
      c.fill();
    });
  };
  c.globalAlpha = 0.35;
  points(plain, ink);
  c.globalAlpha = 1;
  points(values, accent);
  c.fillStyle = ink;
  c.beginPath();
  c.arc(x(mode), y(values[mode] ?? 0), 4, 0, 7);
  c.fill();
}
