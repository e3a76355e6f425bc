// Fields on the surface: strokes comb a vector field, an n-field is drawn as a hatching, curvature tensors are smoothed.

import type { Object3D } from "three";
import { ApiError, numbers, post, postNumbers, type Basis, type Parameters } from "../api";
import type { App, Panel } from "../app";
import { brief, choice, field, grouped, h, plural, slider } from "../dom";
import { latest } from "../latest";
import { dots, Glyphs, ribbons, spread, strands } from "../lines";
import type { Hit } from "../surface";
import { basisHead, type Look } from "./basis";
import { expected } from "./expected";

interface Design {
  weights: { harmonic: number; biharmonic: number };
  strokes: { points: number[][]; strength: number }[];
  constraints: { point: number[]; direction: number[] }[];
  singularities?: { at: { vertex: number; index: number }[]; weight: number; exact: boolean };
  alignment?: { to: "curvature"; weight: number; per_face?: "anisotropy" };
}

/** Glyphs on the screen. */
const GLYPHS = 2600;
/** Points of one stroke that are sent. */
const POINTS = 60;
const ROSE = 0xc2185b;
const PIN = 0x7b1fa2;
const INK = 0x14325c;

const unit = (from: number[], to: number[]) => {
  const d = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
  const length = Math.hypot(d[0], d[1], d[2]) || 1;
  return d.map((x) => x / length);
};

export function fieldsPanel(app: App, look: Look): Panel {
  const head = basisHead(app, "field_basis", "field basis", form(app));
  const body = h("div", { hidden: true });
  const timing = h("p", { class: "dim" });
  const facts = h("p", { "aria-live": "polite" });
  let strokes: number[][][] = [];
  let pins: { from: number[]; to: number[] }[] = [];
  let singular: { vertex: number; index: number }[] = [];
  let tool = "comb";
  let glyphs: Glyphs | null = null;
  let shown = "glyphs";

  const parameters = () => (app.basis?.kind === "field_basis" ? app.basis.parameters : null);
  const kind = () => parameters()?.field ?? "vector";
  const order = () => (kind() === "n_vector" ? (parameters()?.n ?? 4) : kind() === "tensor" ? 2 : 1);
  const aligned = () => order() % 2 === 0;

  const design = (): Design => {
    const along = alignment.control.valueAsNumber;
    return {
      weights: { harmonic: 10 ** smooth.control.valueAsNumber, biharmonic: 10 ** smooth.control.valueAsNumber * bending.control.valueAsNumber },
      strokes: (kind() === "tensor" ? [] : strokes).filter((points) => points.length > 1).map((points) => ({ points, strength: 10 ** strength.control.valueAsNumber })),
      constraints: (kind() === "tensor" ? [] : pins).filter(({ from, to }) => from !== to).map(({ from, to }) => ({ point: from, direction: unit(from, to) })),
      ...(singular.length > 0 && balanced() ? { singularities: { at: singular, weight: 1000, exact: pins.length === 0 } } : {}),
      ...(aligned() && along > 0 ? { alignment: { to: "curvature" as const, weight: along, ...(kind() === "tensor" ? {} : { per_face: "anisotropy" as const }) } } : {}),
    };
  };
  /** On a closed surface the indices have to add up; until they do, they are only shown. */
  const balanced = () => {
    const report = app.mesh?.report;
    if (!report || report.boundary_loops > 0 || report.components > 1) return true;
    return Math.abs(singular.reduce((sum, { index }) => sum + index, 0) - report.euler_characteristic) < 1e-9;
  };
  const nothing = (wish: Design) => wish.strokes.length === 0 && wish.constraints.length === 0 && !wish.singularities && !wish.alignment;
  /** Numbers for each face that a drawing needs and no more: the other directions of an n-field are turns of the first. */
  const wide = () => (kind() === "tensor" ? "roots" : "world");

  const draw = (basis: Basis, vectors: Float32Array) => {
    const surface = app.viewer.surface;
    if (!surface || app.basis !== basis || app.panel !== panel) return;
    if (!glyphs) {
      const drawing = kind() === "tensor" ? { kind: "axes" as const } : order() === 1 ? { kind: "arrows" as const } : { kind: "star" as const, n: order() };
      glyphs = new Glyphs(surface, spread(surface, GLYPHS), drawing, 0.006 * app.viewer.radius, INK);
      app.viewer.overlay("glyphs", glyphs.object);
    }
    glyphs.set(vectors);
    app.viewer.draw();
    document.body.dataset.designed = String(Number(document.body.dataset.designed ?? 0) + 1);
  };
  const send = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    const begin = performance.now();
    // Without a wish, the smoothest field there is.
    const vectors = nothing(wish)
      ? await numbers(`${basis.links.self}/eigenfields?from=0&form=${wide()}`)
      : await postNumbers(`${basis.links.self}/design?form=${wide()}`, wish);
    draw(basis, vectors);
    timing.textContent = `${brief(performance.now() - begin)} ms for a field on ${grouped(vectors.length / (kind() === "tensor" ? 6 : 3))} faces`;
  }, app.fail);

  const update = () => {
    const basis = app.basis;
    if (!basis) return;
    showStrokes();
    lines(null);
    send({ basis, wish: design() });
  };

  // --- what is told once a stroke has ended ---------------------------------------------------------------------------------

  const judge = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    app.viewer.overlay("singularities", null);
    facts.textContent = "";
    const wanted = singular.reduce((sum, { index }) => sum + index, 0);
    if (singular.length > 0 && !balanced()) facts.textContent = `The indices add up to ${brief(wanted)} so far; on this surface they have to make ${app.mesh?.report.euler_characteristic}.`;
    if (nothing(wish)) return;
    const answer = await post<{ singularities: { vertex: number; index: number }[]; index_sum: number; euler_characteristic: number; harmonic_energy: number; biharmonic_energy: number }>(
      `${basis.links.self}/design?singularities=true`, wish);
    const surface = app.viewer.surface;
    if (app.basis !== basis || app.panel !== panel || !surface) return;
    const found = answer.singularities;
    app.viewer.overlay("singularities", shown === "fur" ? null : dots(found.map(({ vertex, index }) => [
      surface.positions[3 * vertex], surface.positions[3 * vertex + 1], surface.positions[3 * vertex + 2], index > 0 ? 0xe08a3a : 0x1f5fa8,
    ]), 0.014 * app.viewer.radius));
    if (balanced() || singular.length === 0) {
      facts.replaceChildren(h("b", {}, plural(found.length, "singularity", "singularities")),
        `, indices sum to ${brief(answer.index_sum)} (Euler characteristic ${answer.euler_characteristic})${found.length ? ": orange turns with the way around, blue against it" : ""}. Energy ${brief(answer.harmonic_energy)}.`);
    }
    document.body.dataset.singular = String(found.length);
  }, app.fail);
  const settled = () => {
    const basis = app.basis;
    if (!basis) return;
    if (kind() !== "tensor") judge({ basis, wish: design() });
    if (shown !== "glyphs") trace({ basis, wish: design() });
  };

  // --- lines: hatching and fur ---------------------------------------------------------------------------------------------

  const lines = (object: Object3D | null) => {
    app.viewer.overlay("lines", object);
    app.kept.lines = null;
    if (glyphs) glyphs.object.visible = object === null;
  };
  const source = async (basis: Basis, wish: Design) =>
    nothing(wish) ? { eigenfield: 0 } : { coefficients: (await post<{ coefficients: number[] }>(`${basis.links.self}/design`, wish)).coefficients };
  const trace = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    const begin = performance.now();
    const field = await source(basis, wish);
    if (shown === "fur") {
      const numbers = await postNumbers(`${basis.links.self}/fur`, { field, length: 0.07 * app.viewer.radius, tilt: 1.2, full: 0.5 });
      if (app.basis !== basis || app.panel !== panel || shown !== "fur") return;
      const { object, count } = strands(numbers, 60_000, 0.007 * app.viewer.radius, 0x2b190d, 0xd9ac77);
      lines(object);
      timing.textContent = `${plural(count, "strand")} in ${brief(performance.now() - begin)} ms`;
    } else {
      const answer = await post<{ lines: { points: number[][]; faces: number[] }[] }>(`${basis.links.self}/hatching`, { field, spacing: 10 ** spacing.control.valueAsNumber, most_lines: 20_000 });
      const surface = app.viewer.surface;
      if (app.basis !== basis || app.panel !== panel || shown !== "hatching" || !surface) return;
      lines(ribbons(surface, answer.lines, 0.0045 * app.viewer.radius, 0.003 * app.viewer.radius, INK));
      app.kept.lines = answer.lines.map(({ points }) => points);
      timing.textContent = `${plural(answer.lines.length, "line")} in ${brief(performance.now() - begin)} ms`;
    }
    document.body.dataset.traced = shown;
  }, app.fail);

  // --- strokes -------------------------------------------------------------------------------------------------------------

  const showStrokes = () => {
    const { viewer } = app;
    const places: [number, number, number, number][] = strokes.flat().map(([x, y, z]) => [x, y, z, ROSE]);
    for (const { from, to } of pins) {
      for (let t = 0; t <= 1; t += 0.2) places.push([0, 1, 2].map((k) => from[k] + t * (to[k] - from[k])).concat(PIN) as [number, number, number, number]);
    }
    const p = viewer.surface?.positions;
    if (p) for (const { vertex, index } of singular) places.push([p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2], index > 0 ? 0xe08a3a : 0x1f5fa8]);
    viewer.overlay("strokes", places.length && shown !== "fur" && kind() !== "tensor" ? dots(places, 0.0085 * viewer.radius) : null);
  };
  const onStroke = (hit: Hit, phase: "begin" | "move"): boolean | "point" => {
    if (tool === "turn" || kind() === "tensor") return false;
    if (tool === "plus" || tool === "minus") {
      if (phase === "begin") {
        const index = (tool === "plus" ? 1 : -1) / order();
        const known = singular.some(({ vertex }) => vertex === hit.vertex);
        singular = known ? singular.filter(({ vertex }) => vertex !== hit.vertex) : [...singular, { vertex: hit.vertex, index }];
      }
      return "point";
    }
    if (tool === "pin") {
      if (phase === "begin") pins.push({ from: hit.point, to: hit.point });
      else {
        pins[pins.length - 1].to = hit.point;
        update();
      }
      return true;
    }
    if (phase === "begin") strokes.push([]);
    const points = strokes[strokes.length - 1];
    const last = points[points.length - 1];
    const step = last ? Math.hypot(hit.point[0] - last[0], hit.point[1] - last[1], hit.point[2] - last[2]) : Infinity;
    // A jump leads over the edge of what is seen: the stroke goes on as another.
    if (last && step > 0.5 * app.viewer.radius) {
      strokes.push([hit.point]);
      return true;
    }
    if (step < 0.012 * app.viewer.radius) return true;
    points.push(hit.point);
    if (points.length > POINTS) strokes.push([hit.point]);
    if (points.length > 1) update();
    return true;
  };
  const onStrokeEnd = () => {
    strokes = strokes.filter((points) => points.length > 1);
    pins = pins.filter(({ from, to }) => from !== to);
    update();
    settled();
  };

  // --- controls ------------------------------------------------------------------------------------------------------------

  const tools = choice([["comb", "comb (soft)"], ["pin", "pin (exact)"], ["plus", "singularity +"], ["minus", "singularity −"], ["turn", "turn the surface"]], tool, (value) => (tool = value));
  const toolField = field("Pointer", tools);
  const remove = (all: boolean) => {
    if (all) [strokes, pins, singular] = [[], [], []];
    else if (tool === "pin") pins = pins.slice(0, -1);
    else if (tool === "plus" || tool === "minus") singular = singular.slice(0, -1);
    else strokes = strokes.slice(0, -1);
    update();
    settled();
  };
  const release = () => {
    update();
    settled();
  };
  const knob = (label: string, range: { min: number; max: number; step: number; value: number }, format: (value: number) => string) => {
    const made = slider(label, range, update, format);
    made.control.addEventListener("change", release);
    return made;
  };
  const strength = knob("Strength", { min: -2, max: 2, step: 0.1, value: 0 }, (value) => brief(10 ** value));
  const smooth = knob("Smoothness", { min: -4, max: 1, step: 0.1, value: 0 }, (value) => brief(10 ** value));
  const bending = knob("Biharmonic", { min: 0.05, max: 1, step: 0.05, value: 0.05 }, brief);
  const alignment = knob("Curvature", { min: 0, max: 5, step: 0.1, value: 0 }, (value) => (value ? brief(value) : "ignored"));
  const spacing = slider("Spacing", { min: -2.2, max: -1, step: 0.05, value: -1.85 }, () => {}, (value) => brief(10 ** value));
  spacing.control.addEventListener("change", settled);
  const display = h("div", {});
  const row = h("div", { class: "row" }, h("button", { onclick: () => remove(false) }, "Undo"), h("button", { onclick: () => remove(true) }, "Clear"));
  const hint = h("p", {});
  body.append(hint, toolField, row, display, spacing.element, strength.element, smooth.element, bending.element, alignment.element, facts, timing);

  const showDisplay = () => {
    const kinds: [string, string][] = [["glyphs", kind() === "vector" ? "arrows" : "crosses"], ["hatching", kind() === "vector" ? "streamlines" : "hatching"]];
    if (kind() === "vector") kinds.push(["fur", "fur"]);
    if (!kinds.some(([name]) => name === shown)) shown = "glyphs";
    display.replaceChildren(field("Show", choice(kinds, shown, (value) => {
      shown = value;
      spacing.element.hidden = shown !== "hatching";
      update();
      settled();
    })));
    spacing.element.hidden = shown !== "hatching";
  };

  let before: string | undefined;
  let mesh: string | undefined;
  const panel: Panel = {
    id: "fields",
    title: "Fields",
    about: "Design vector fields and crosses that follow your strokes, as smooth as the surface allows.",
    kind: "field_basis",
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      const basis = app.basis;
      body.hidden = basis === null;
      look.show(null);
      app.title.textContent = app.mesh?.name ?? "";
      glyphs = null;
      if (!basis) return;
      if (before !== basis.id) singular = [];
      if (mesh !== basis.mesh) [strokes, pins] = [[], []];
      [before, mesh] = [basis.id, basis.mesh ?? undefined];
      facts.textContent = "";
      const tensor = kind() === "tensor";
      hint.textContent = tensor
        ? "Curvature tensors in this space: the weights steer, live, how smooth they are."
        : "Draw on the surface: the field follows the stroke. Beside the surface, dragging turns it.";
      row.hidden = toolField.hidden = tensor;
      strength.element.hidden = tensor;
      alignment.element.hidden = !aligned();
      alignment.set(tensor ? 1 : alignment.control.valueAsNumber);
      if (tensor) smooth.set(-2);
      showDisplay();
      app.viewer.onStroke = tensor ? null : onStroke;
      app.viewer.onStrokeEnd = onStrokeEnd;
      update();
      settled();
    },
    hide() {
      for (const name of ["glyphs", "strokes", "singularities", "lines"]) app.viewer.overlay(name, null);
      glyphs = null;
      app.viewer.onStroke = null;
      delete document.body.dataset.designed;
      delete document.body.dataset.traced;
      delete document.body.dataset.singular;
    },
  };
  return panel;
}

/** The form of a field basis. */
function form(app: App): HTMLElement {
  const kinds = choice([["vector", "vectors"], ["2", "lines (2-field)"], ["4", "crosses (4-field)"], ["6", "6-field"], ["tensor", "symmetric tensors"]], "vector", () => {});
  const dimension = h("input", { type: "number", min: "10", max: "40000", value: "500" });
  const parameters = (): Parameters<"field_basis"> => {
    const n = Number(kinds.value);
    return { ...(n ? { field: "n_vector", n } : { field: kinds.value as "vector" | "tensor" }), dimension: dimension.valueAsNumber };
  };
  const made = h("form", { class: "form", onsubmit: (event: Event) => {
    event.preventDefault();
    if (!app.mesh) return app.fail(new ApiError({ type: "", title: "No surface is open", detail: "Open one first." }));
    void app.submit("field_basis", parameters());
  } }, field("Field", kinds), field("Dimension", dimension, "Columns of the space"), h("button", { class: "primary" }, "Compute"));
  made.append(expected(app, made, "field_basis", parameters));
  return made;
}
