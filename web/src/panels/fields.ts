// Fields on the surface: strokes comb a vector field, an n-field is drawn as a hatching, curvature tensors are smoothed.

import type { Object3D } from "three";
import { post, postNumbers, type Basis } from "../api";
import type { App, Panel } from "../app";
import { brief, choice, field, grouped, h, plural, slider } from "../dom";
import { latest } from "../latest";
import { dots, Glyphs, ribbons, spread, strands } from "../lines";
import type { Hit } from "../surface";
import { packed, unpacked } from "../strokes";
import { basisHead } from "./basis";
import { eigenfield, fieldForm } from "./fieldform";
import { lengths } from "./hodge";
import { sequential, type Look } from "./look";

interface Pinned {
  point: number[];
  direction: number[];
  /** Of a tensor, its eigenvalues along the direction and across it. */
  values?: [number, number];
}

interface Design {
  weights: { harmonic: number; biharmonic: number };
  strokes: ({ points: number[][]; strength: number } | (Pinned & { strength: number }))[];
  constraints: Pinned[];
  singularities?: { at: { vertex: number; index: number }[]; exact: boolean };
  alignment?: { to: "curvature"; weight: number; per_face?: "anisotropy" };
  space?: "basis";
}

/** What an address keeps: what was drawn, in thousandths of the radius, and where the sliders stand. */
interface State {
  strokes: number[][];
  pins: number[][];
  singular: [vertex: number, index: number][];
  exact: boolean;
  shown: string;
  knobs: number[];
}

/** Glyphs on the screen. */
const GLYPHS = 2600;
/** Surfaces of more faces show a field of the space while something moves, and one of all fields of the surface as soon as it rests. */
const SWIFT = 150_000;
/** Up to so many faces the page asks how far off a field of the space is. */
const JUDGED = 600_000;
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
  const head = basisHead(app, () => panel, "field basis", fieldForm(app, () => inFrames()));
  const body = h("div", { hidden: true });
  const timing = h("p", { class: "dim" });
  const facts = h("p", { "aria-live": "polite" });
  const lowest = h("p", {});
  const looks = h("div", {});
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
  const faces = () => app.mesh?.report.faces ?? 0;

  const design = (): Design => {
    const pull = alignment.control.valueAsNumber;
    return {
      weights: { harmonic: 10 ** smooth.control.valueAsNumber, biharmonic: 10 ** smooth.control.valueAsNumber * bending.control.valueAsNumber },
      strokes: strokes.filter((points) => points.length > 1).flatMap(stroke),
      constraints: pins.filter(({ from, to }) => from !== to).map(({ from, to }) => ({ point: from, direction: unit(from, to), ...tensor() })),
      ...(singular.length > 0 && balanced() ? { singularities: { at: singular, exact: exact.checked && pins.length === 0 } } : {}),
      ...(aligned() && pull > 0 ? { alignment: { to: "curvature" as const, weight: pull, ...(kind() === "tensor" ? {} : { per_face: "anisotropy" as const }) } } : {}),
    };
  };
  /** What a stroke says of a tensor: how large it is along it and across it, in a unit of curvature. */
  const tensor = (): { values?: [number, number] } =>
    kind() === "tensor" ? { values: [along, across].map(({ control }) => control.valueAsNumber / app.viewer.radius) as [number, number] } : {};
  /** A line for directions; for tensors, whose lines have no size, a point with a direction for each of its pieces. */
  const stroke = (points: number[][]): Design["strokes"] => {
    const firmness = 10 ** strength.control.valueAsNumber;
    if (kind() !== "tensor") return [{ points, strength: firmness }];
    return points.slice(1).map((to, i) => ({ point: points[i].map((x, k) => (x + to[k]) / 2), direction: unit(points[i], to), ...tensor(), strength: firmness }));
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
    app.kept.field = { values: vectors, columns: kind() === "tensor" ? 6 : 3 };
    if (coloured.checked) look.show(sequential(lengths(vectors, surface, kind() === "tensor" ? 6 : 3), 0.995));
    else if (look.values) look.show(null);
    look.element.hidden = !coloured.checked;
    app.viewer.draw();
    document.body.dataset.designed = String(Number(document.body.dataset.designed ?? 0) + 1);
  };
  const send = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    const begin = performance.now();
    // Without a wish, the smoothest field there is.
    const k = which.control.valueAsNumber;
    const vectors = nothing(wish)
      ? await eigenfield(basis, k, wide())
      : await postNumbers(`${basis.links.self}/design?form=${wide()}`, wish);
    draw(basis, vectors);
    timing.textContent = `${brief(performance.now() - begin)} ms for a field on ${grouped(vectors.length / (kind() === "tensor" ? 6 : 3))} faces`;
    if (nothing(wish) && app.basis === basis && app.panel === panel) {
      const off = basis.kind === "field_basis" ? basis.certificate?.estimates[k] : undefined;
      const far = off === undefined ? "" : `; the exact value is about ${brief(Math.max(basis.eigenvalues[k] - off, 0))}`;
      lowest.replaceChildren(h("b", {}, `Eigenfield ${k}`), `: λ ≈ ${brief(basis.eigenvalues[k])}, approached from above${far}.`);
      document.body.dataset.eigenfield = String(k);
    } else {
      lowest.replaceChildren();
      delete document.body.dataset.eigenfield;
    }
  }, app.fail);
  /** The field on the screen, in the frames of the faces. */
  const inFrames = async () => {
    const basis = app.basis;
    if (basis?.kind !== "field_basis") return null;
    const wish = design();
    return { basis, values: nothing(wish) ? await eigenfield(basis, which.control.valueAsNumber, "frames") : await postNumbers(`${basis.links.self}/design?form=frames`, wish) };
  };

  const update = (moving = false) => {
    const basis = app.basis;
    if (!basis) return;
    keep();
    const wish = design();
    which.element.hidden = !nothing(wish);
    showStrokes();
    lines(null);
    send({ basis, wish: moving && faces() > SWIFT ? { ...wish, space: "basis" } : wish });
  };

  // --- what is told once a stroke has ended ---------------------------------------------------------------------------------

  const judge = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    app.viewer.overlay("singularities", null);
    facts.textContent = "";
    const wanted = singular.reduce((sum, { index }) => sum + index, 0);
    if (singular.length > 0 && !balanced()) facts.textContent = `The indices add up to ${brief(wanted)} so far; on this surface they have to make ${app.mesh?.report.euler_characteristic}.`;
    if (nothing(wish)) return;
    const answer = await post<{ singularities: { vertex: number; index: number }[]; index_sum: number; euler_characteristic: number; harmonic_energy: number; matching: unknown[] | null; space: string; error: number | null }>(
      `${basis.links.self}/design?singularities=true`, wish.singularities || faces() > JUDGED ? wish : { ...wish, error: true });
    const surface = app.viewer.surface;
    if (app.basis !== basis || app.panel !== panel || !surface) return;
    const found = answer.singularities;
    app.viewer.overlay("singularities", shown === "fur" ? null : dots(found.map(({ vertex, index }) => [
      surface.positions[3 * vertex], surface.positions[3 * vertex + 1], surface.positions[3 * vertex + 2], index > 0 ? 0xe08a3a : 0x1f5fa8,
    ]), 0.014 * app.viewer.radius));
    if (balanced() || singular.length === 0) {
      facts.replaceChildren(h("b", {}, plural(found.length, "singularity", "singularities")),
        `, indices sum to ${brief(answer.index_sum)} (Euler characteristic ${answer.euler_characteristic})${found.length ? ": orange turns with the way around, blue against it" : ""}. Energy ${brief(answer.harmonic_energy)}.${wish.singularities?.exact ? " Exactly those that were asked for, and no others." : ""}${answer.matching?.length ? ` Across ${plural(answer.matching.length, "edge")} the field turns by more than half a turn.` : ""}${whose(answer)}`);
    }
    document.body.dataset.singular = String(found.length);
  }, app.fail);
  /** Of which fields it is the one of least energy. */
  const whose = ({ space, error }: { space: string; error: number | null }) =>
    space === "surface" ? " The smoothest of all fields of the surface." : error === null ? "" : ` The smoothest field of this space, ${brief(100 * error)} % off that of the surface: a larger space comes closer.`;
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
  // Not by its coefficients: a field of the whole surface is none of the space.
  const source = (wish: Design) => (nothing(wish) ? { eigenfield: which.control.valueAsNumber } : { design: wish });
  const trace = latest<{ basis: Basis; wish: Design }>(async ({ basis, wish }) => {
    const begin = performance.now();
    const field = source(wish);
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
    viewer.overlay("strokes", places.length && shown !== "fur" ? dots(places, 0.0085 * viewer.radius) : null);
  };
  const onStroke = (hit: Hit, phase: "begin" | "move"): boolean | "point" => {
    if (tool === "turn") return false;
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
        update(true);
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
    if (points.length > 1) update(true);
    return true;
  };
  const onStrokeEnd = () => {
    strokes = strokes.filter((points) => points.length > 1);
    pins = pins.filter(({ from, to }) => from !== to);
    update();
    settled();
  };

  // --- controls ------------------------------------------------------------------------------------------------------------

  const tools = choice([], tool, (value) => (tool = value));
  const toolField = field("Pointer", tools);
  const showTools = () => {
    const singularities: [string, string][] = kind() === "tensor" ? [] : [["plus", "singularity +"], ["minus", "singularity −"]];
    const offered: [string, string][] = [["comb", "comb (soft)"], ["pin", "pin (exact)"], ...singularities, ["turn", "turn the surface"]];
    tools.replaceChildren(...offered.map(([value, text]) => h("option", { value }, text)));
    if (!offered.some(([value]) => value === tool)) tool = "comb";
    tools.value = tool;
  };
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
  const knob = (label: string, range: { min: number; max: number; step: number; value: number }, format: (value: number) => string, hint: string) => {
    const made = slider(label, range, () => update(true), format, hint);
    made.control.addEventListener("change", release);
    return made;
  };
  const strength = knob("Strength", { min: -2, max: 2, step: 0.1, value: 0 }, (value) => brief(10 ** value), "How firmly the field follows a stroke: 1 to a percent, 0.1 to a tenth");
  const smooth = knob("Smoothness", { min: -4, max: 1, step: 0.1, value: 0 }, (value) => brief(10 ** value), "How much the field resists to being turned, against strokes and curvature");
  const bending = knob("Biharmonic", { min: 0.05, max: 1, step: 0.05, value: 0.05 }, brief, "How far the field goes on in the direction of a stroke before it gives way");
  const alignment = knob("Curvature", { min: 0, max: 5, step: 0.1, value: 0 }, (value) => (value ? brief(value) : "ignored"), "How strongly the field is pulled to the directions in which the surface bends most and least");
  const along = knob("Along", { min: -5, max: 5, step: 0.25, value: 3 }, brief, "Curvature along a stroke, in units of one over the radius");
  const across = knob("Across", { min: -5, max: 5, step: 0.25, value: 0 }, brief, "Curvature across a stroke, in units of one over the radius");
  const which = knob("Eigenfield", { min: 0, max: 1, step: 1, value: 0 }, grouped, "The smoothest fields of all, in order; they are shown while nothing is drawn");
  const exact = h("input", { type: "checkbox", checked: true, onchange: () => release() });
  const exactly = h("label", { class: "row", title: "A field of length 1 with these singularities and no others, on any mesh; it is not of the space" }, exact, "singularities exactly");
  const coloured = h("input", { type: "checkbox", onchange: () => release() });
  const spacing = slider("Spacing", { min: -2.2, max: -1, step: 0.05, value: -1.85 }, () => {}, (value) => brief(10 ** value));
  spacing.control.addEventListener("change", settled);
  const display = h("div", {});
  const row = h("div", { class: "row" }, h("button", { onclick: () => remove(false) }, "Undo"), h("button", { onclick: () => remove(true) }, "Clear"));
  const hint = h("p", {});
  body.append(hint, toolField, row, exactly, which.element, display, h("label", { class: "row" }, coloured, "colour by length"), looks, spacing.element, strength.element, along.element, across.element, smooth.element, bending.element, alignment.element, lowest, facts, timing);

  const showDisplay = () => {
    const kinds: [string, string][] = [["glyphs", order() === 1 ? "arrows" : order() === 3 || order() === 6 ? "stars" : "crosses"], ["hatching", kind() === "vector" ? "streamlines" : "hatching"]];
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
    guide: "fields",
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
      const tensors = kind() === "tensor";
      if (before !== basis.id && tensors) {
        alignment.set(1);
        smooth.set(-2);
      }
      [before, mesh] = [basis.id, basis.mesh ?? undefined];
      facts.textContent = "";
      hint.textContent = tensors
        ? "Curvature tensors in this space: the weights steer, live, how smooth they are. Strokes change them: how much they bend along the stroke and across it, in units of one over the radius."
        : "Draw on the surface: the field follows the stroke. Beside the surface, dragging turns it.";
      along.element.hidden = across.element.hidden = !tensors;
      exactly.hidden = tensors;
      alignment.element.hidden = !aligned();
      which.control.max = String(Math.max(Math.min(basis.eigenvalues.length, 100) - 1, 0));
      which.set(Math.min(which.control.valueAsNumber, Number(which.control.max)));
      const state = app.arrived<Partial<State>>("fields");
      if (state) adopt(state);
      showTools();
      showDisplay();
      looks.append(look.element);
      look.element.hidden = true;
      app.viewer.onStroke = onStroke;
      app.viewer.onStrokeEnd = onStrokeEnd;
      update();
      settled();
    },
    hide() {
      look.element.hidden = false;
      app.kept.field = null;
      for (const name of ["glyphs", "strokes", "singularities", "lines"]) app.viewer.overlay(name, null);
      glyphs = null;
      app.viewer.onStroke = null;
      delete document.body.dataset.designed;
      delete document.body.dataset.traced;
      delete document.body.dataset.singular;
      delete document.body.dataset.eigenfield;
    },
  };

  // --- what an address keeps -----------------------------------------------------------------------------------------------

  const knobs = () => [strength, smooth, bending, alignment, spacing, along, across, which];
  const keep = () => {
    const state: State = {
      strokes: strokes.filter((points) => points.length > 1).map((points) => packed(app.viewer, points)),
      pins: pins.filter(({ from, to }) => from !== to).map(({ from, to }) => packed(app.viewer, [from, to])),
      singular: singular.map(({ vertex, index }) => [vertex, Math.round(index * order())]),
      exact: exact.checked, shown, knobs: knobs().map(({ control }) => control.valueAsNumber),
    };
    app.keep(state);
  };
  /** Takes over what an address says, as far as it makes sense. */
  const adopt = (state: Partial<State>) => {
    const list = (value: unknown) => (Array.isArray(value) ? value : []);
    const count = (app.viewer.resting?.length ?? 0) / 3;
    strokes = list(state.strokes).map((numbers) => unpacked(app.viewer, numbers)).filter((points) => points.length > 1);
    pins = list(state.pins).map((numbers) => unpacked(app.viewer, numbers)).filter((points) => points.length === 2).map(([from, to]) => ({ from, to }));
    singular = list(state.singular).filter((pair) => Array.isArray(pair) && pair.every(Number.isInteger) && pair[0] >= 0 && pair[0] < count).map(([vertex, turns]) => ({ vertex, index: turns / order() }));
    if (typeof state.exact === "boolean") exact.checked = state.exact;
    if (["glyphs", "hatching", "fur"].includes(state.shown ?? "")) shown = state.shown!;
    list(state.knobs).forEach((value, k) => typeof value === "number" && knobs()[k]?.set(value));
  };
  return panel;
}
