// The form of a field basis: which fields, what they do at a boundary, and where the space is finer.

import { ApiError, numbers, type Basis, type Parameters } from "../api";
import type { App } from "../app";
import { choice, field, h } from "../dom";
import type { Surface } from "../surface";
import { expected } from "./expected";

/** How much finer than elsewhere a space is at most where the surface bends. */
const FINEST = 6;

/** A weight for each face: 1 where the surface is flat, more where its normals differ. */
export function bending({ triangles: t }: Surface, normals: (vertex: number) => number[]): number[] {
  const turns: number[] = [];
  for (let f = 0; f < t.length; f += 3) {
    const [a, b, c] = [normals(t[f]), normals(t[f + 1]), normals(t[f + 2])];
    const apart = (u: number[], v: number[]) => Math.hypot(u[0] - v[0], u[1] - v[1], u[2] - v[2]);
    turns.push(Math.max(apart(a, b), apart(b, c), apart(c, a)));
  }
  const usual = turns.slice().sort((a, b) => a - b)[turns.length >> 1] || 1;
  return turns.map((turn) => Number(Math.min(Math.max(turn / usual, 1), FINEST).toPrecision(3)));
}

/** `design` gives the field on the screen in the frames of the faces, where there is one. */
export function fieldForm(app: App, design: () => Promise<{ basis: Basis; values: Float32Array } | null>): HTMLElement {
  const kinds = choice([["vector", "vectors"], ["1", "1-field (one direction)"], ["2", "lines (2-field)"], ["3", "3-field"], ["4", "crosses (4-field)"], ["6", "6-field"], ["tensor", "symmetric tensors"]], "vector", () => update());
  const dimension = h("input", { type: "number", min: "10", max: "40000", value: "500" });
  const boundary = choice([["tangential", "along it (tangential)"], ["normal", "across it (normal)"], ["clamped", "zero (clamped)"]], "tangential", () => {});
  const accuracy = choice([["standard", "standard"], ["accurate", "accurate"]], "standard", () => {});
  const adapt = choice([["none", "evenly"], ["bending", "finer where the surface bends"], ["shown", "finer where the field shown changes"]], "none", () => {});
  const boundaries = field("Boundary", boundary, "What fields of low energy do at a boundary");
  const update = () => (boundaries.hidden = kinds.value !== "vector" || (app.mesh?.report.boundary_loops ?? 0) === 0);
  app.on("mesh", update);
  update();
  const parameters = (): Parameters<"field_basis"> => {
    const n = Number(kinds.value);
    return {
      ...(n ? { field: "n_vector", n } : { field: kinds.value as "vector" | "tensor" }), dimension: dimension.valueAsNumber,
      ...(boundaries.hidden ? {} : { boundary: boundary.value as "tangential" | "normal" | "clamped" }),
      ...(accuracy.value === "standard" ? {} : { accuracy: "accurate" as const }),
    };
  };
  /** Where columns are to be dense. */
  const adapted = async (): Promise<Partial<Parameters<"field_basis">>> => {
    const surface = app.viewer.surface;
    if (adapt.value === "bending" && surface) return { weights: bending(surface, (v) => app.viewer.normalAt(v)!) };
    if (adapt.value !== "shown") return {};
    const shown = await design();
    if (!shown) throw new ApiError({ type: "", title: "No field is shown", detail: "Design one first, in an even space: a space that is finer where that field changes is made of it." });
    const wide = shown.values.length / ((surface?.triangles.length ?? 3) / 3);
    return { examples: [Array.from({ length: shown.values.length / wide }, (_, f) => Array.from(shown.values.subarray(wide * f, wide * (f + 1)))).flat()] };
  };
  const made = h("form", { class: "form", onsubmit: (event: Event) => {
    event.preventDefault();
    if (!app.mesh) return app.fail(new ApiError({ type: "", title: "No surface is open", detail: "Open one first." }));
    adapted().then((more) => app.submit("field_basis", { ...parameters(), ...more })).catch(app.fail);
  } }, field("Field", kinds), field("Dimension", dimension, "Columns of the space"), field("Columns", adapt, "Where they are small and dense"), field("Accuracy", accuracy), boundaries, h("button", { class: "primary" }, "Compute"));
  made.append(expected(app, made, "field_basis", parameters, async () => ({ ...parameters(), ...(await adapted()) })));
  return made;
}

/** An approximate eigenfield. */
export const eigenfield = (basis: Basis, k: number, form: string) => numbers(`${basis.links.self}/eigenfields?from=${k}&to=${k + 1}&form=${form}`);
