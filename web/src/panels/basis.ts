// What the tabs share: which basis is open, how to ask for another, and how the surface is coloured.

import type { BasisSummary, Eigenbasis, Parameters } from "../api";
import type { App, Panel } from "../app";
import { brief, choice, field, grouped, h, plural, refill, seconds, slider } from "../dom";
import { expected } from "./expected";
import type { Look } from "./look";

/** One line about a basis. */
export function line(basis: BasisSummary): string {
  const parts = [grouped(basis.count)];
  if (basis.kind === "field_basis") parts.unshift(fieldName(basis.parameters));
  if ("method" in basis.parameters && basis.parameters.method) parts.push(basis.parameters.method);
  if ("tolerance" in basis.parameters && basis.parameters.tolerance) parts.push(`to ${brief(basis.parameters.tolerance)}`);
  const operator = basis.kind === "eigenbasis" ? basis.parameters.operator : null;
  if (operator && operator !== "auto") parts.push(typeof operator === "string" ? operator : Object.keys(operator)[0]);
  return parts.join(" · ");
}

/** Whether functions are what this basis holds: not fields, and not the inside of a solid. */
export const ofFunctions = (basis: BasisSummary) =>
  basis.kind === "eigenbasis" && basis.parameters.operator !== "hodge" && basis.parameters.operator !== "volume";

/** The operator of a basis with its boundary condition, so that two can be compared. */
export const operatorOf = (basis: BasisSummary) => (basis.kind === "eigenbasis" ? JSON.stringify([basis.parameters.operator, basis.parameters.boundary]) : "");

/** What kind of field, in a word. */
export const fieldName = ({ field, n }: { field?: string; n?: number | null }) => (field === "n_vector" ? `${n}-field` : (field ?? "vector"));

/** The head of a tab: its bases, and a form that makes another. The form is open where there is none yet. */
export function basisHead(app: App, panel: () => Panel, name: string, form: HTMLElement): { element: HTMLElement; update: () => void } {
  const chooser = h("div", {});
  const details = h("details", { class: "new" }, h("summary", {}, `New ${name} …`), form);
  const update = () => {
    const bases = app.basesOf(panel());
    if (bases.length === 0) chooser.replaceChildren();
    else {
      const select = choice(bases.map((basis) => [basis.id, `${bases.some((other) => other !== basis && line(other) === line(basis)) ? `${new Date(basis.created_ms).toLocaleTimeString()} · ` : ""}${line(basis)}`]), app.basis?.id ?? "", (id) => app.use(id, true).catch(app.fail), name);
      refill(chooser, field(name[0].toUpperCase() + name.slice(1), select));
    }
    // Whoever is filling it in goes on: a job that ends elsewhere is no reason to fold it.
    const typing = document.activeElement?.matches("input, select") && details.contains(document.activeElement);
    if (!typing) details.open = bases.length === 0;
    details.hidden = app.mesh === null;
  };
  app.on("bases", update);
  app.on("basis", update);
  return { element: h("div", { class: "head" }, chooser, details), update };
}

/** Operators that the hierarchical method alone takes. */
const EXACT_ONLY = ["hodge", "graph"];
/** The longest list of values that goes with a job. */
const MOST_VALUES = 500_000;

/** The form of an eigenbasis. What is shown may become a potential. */
export function eigenForm(app: App, look?: Look): HTMLElement {
  const count = h("input", { type: "number", min: "1", max: "5000", value: "200", "aria-label": "Eigenpairs" });
  const method = choice([["auto", "automatic"], ["approximate", "approximate (fast)"], ["hsim", "exact, certified"]], "auto", () => update());
  const tolerance = choice([["1e-2", "1e-2"], ["1e-4", "1e-4"], ["1e-6", "1e-6"], ["1e-9", "1e-9"]], "1e-2", () => {});
  const accuracy = choice([["standard", "standard: 1 %"], ["accurate", "accurate: 0.3 %"]], "standard", () => {});
  const certify = h("input", { type: "checkbox" });
  const operator = choice([["auto", "Laplace–Beltrami"], ["laplace", "cotangents"], ["polygon", "of the polygons"], ["robust", "robust Laplacian"],
    ["extrinsic", "extrinsic"], ["hamiltonian", "with a potential"], ["hodge", "Hodge–Laplacian (fields)"], ["volume", "inside of a solid"], ["graph", "graph Laplacian"]], "auto", () => update());
  const t = slider("t", { min: 0, max: 1, step: 0.05, value: 0.5 }, () => {}, (value) => value.toFixed(2));
  const potential = choice([["curvature", "curvature, κ₁² + κ₂²"], ["values", "the values shown"]], "curvature", () => update());
  const strength = slider("Strength", { min: -2, max: 4, step: 0.1, value: 2 }, () => {}, (value) => brief(10 ** value));
  const boundary = choice([["neumann", "natural (Neumann)"], ["dirichlet", "zero (Dirichlet)"]], "neumann", () => {});
  const run = choice([["tangential", "fields run along it"], ["normal", "fields run across it"]], "tangential", () => {});
  const tolerances = field("Tolerance", tolerance, "Largest residual of a pair");
  const accuracies = field("Accuracy", accuracy, "Columns are added until the eigenvalues are estimated to be as accurate as this");
  const certified = h("label", { class: "row" }, certify, "prove that none is missing");
  const potentials = field("Potential", potential, "Eigenfunctions stay where it is low");
  const hodge = () => operator.value === "hodge";
  const exact = () => method.value === "hsim" || EXACT_ONLY.includes(operator.value);
  const update = () => {
    tolerances.hidden = !exact();
    accuracies.hidden = certified.hidden = exact();
    method.disabled = EXACT_ONLY.includes(operator.value);
    potentials.hidden = operator.value !== "hamiltonian" || !look;
    strength.element.hidden = potentials.hidden || potential.value !== "values";
    t.element.hidden = operator.value !== "extrinsic" && (operator.value !== "hamiltonian" || potential.value === "values");
    boundaries.hidden = hodge();
    runs.hidden = !hodge();
  };
  const boundaries = field("Boundary", boundary);
  const runs = field("Boundary", run);
  update();
  /** The values on the screen, from 0 to the strength, in the unit of eigenvalues: over the area of the surface. */
  const shown = (): number[] | null => {
    const values = look?.values;
    const area = app.mesh?.report.area;
    if (!values || !area || values.length > MOST_VALUES || !values.every(Number.isFinite)) return null;
    const low = values.reduce((least, value) => Math.min(least, value), Infinity);
    const high = values.reduce((most, value) => Math.max(most, value), -Infinity);
    const scale = 10 ** strength.control.valueAsNumber / area / Math.max(high - low, 1e-30);
    return Array.from(values, (value) => Number((scale * (value - low)).toPrecision(6)));
  };
  /** An estimate needs no list of values, whatever they are. */
  const parameters = (whole = true) => {
    const value = t.control.valueAsNumber;
    const values = whole && operator.value === "hamiltonian" && potential.value === "values" ? shown() : null;
    const chosen = { extrinsic: { extrinsic: { t: value } }, hamiltonian: { hamiltonian: { potential: values ? { values } : { curvature: { t: value } } } } }[operator.value] ?? operator.value;
    // The words of the choices above are those of the server.
    return {
      count: count.valueAsNumber, method: exact() ? "hsim" : method.value, operator: chosen, boundary: hodge() ? run.value : boundary.value,
      ...(exact() ? { tolerance: Number(tolerance.value) } : {}),
      ...(!exact() && accuracy.value !== "standard" ? { accuracy: accuracy.value } : {}),
      ...(!exact() && certify.checked ? { certify: true } : {}),
    } as Parameters<"eigenbasis">;
  };
  const form = h("form", { class: "form", onsubmit: (event: Event) => {
    event.preventDefault();
    if (missing()) return app.toast("error", "Nothing is shown that can be a potential", `Show a function on the surface first, a distance for instance. It has to be finite everywhere, and on ${grouped(MOST_VALUES)} vertices at most.`);
    void app.submit("eigenbasis", parameters());
  } }, field("Eigenpairs", count), field("Method", method), tolerances, accuracies, field("Operator", operator), potentials, strength.element, t.element, boundaries, runs, certified,
    h("button", { class: "primary" }, "Compute"));
  const missing = () => !potentials.hidden && potential.value === "values" && !shown();
  form.append(expected(app, form, "eigenbasis", () => parameters(false), () => (missing() ? null : parameters())));
  return form;
}

/** Why the operator was chosen, where it is worth a word. */
const REASONS: Record<string, string> = {
  non_manifold: ", since the mesh is not manifold",
  thin_faces: ", since the mesh has many thin triangles",
  needle: ", since the mesh has a triangle of almost no height",
};

/** Whether an eigenvalue is zero, but for rounding. */
export const vanishes = ({ eigenvalues }: Eigenbasis, k: number) => Math.abs(eigenvalues[k]) <= 1e-6 * Math.abs(eigenvalues[eigenvalues.length - 1]);

/** What is proven about a basis, in words. */
export function certificate(basis: Eigenbasis): HTMLElement {
  const { certificate: proof, eigenvalues, operator, parameters } = basis;
  const made = "laplacian" in operator ? operator : null;
  const laplacian = made?.laplacian === "robust" ? "the robust Laplacian" : made?.laplacian === "cotangent" ? "the cotangent Laplacian" : made?.laplacian === "polygon" ? "the Laplacian of the polygons" : "the operator";
  const reason = made ? (REASONS[made.reason] ?? "") : "";
  // Nothing is relative to zero, and there is one for each component, or for each harmonic field.
  const relative = eigenvalues.map((value, k) => proof.bounds[k] / Math.abs(value)).filter((_, k) => !vanishes(basis, k)).filter(Number.isFinite).sort((a, b) => a - b);
  const worst = Math.max(...proof.residuals, 0);
  const percent = (value: number) => (value < 1e-6 ? `${brief(value)} of it` : `${brief(100 * value)} %`);
  const hodge = "hodge" in operator ? operator.hodge : null;
  const sentences: HTMLElement[] = [
    hodge
      ? h("p", {}, `${plural(eigenvalues.length, "eigenfield")} of the Hodge–Laplacian: ${grouped(hodge.harmonic)} harmonic, ${plural(hodge.gradients, "gradient")}, ${plural(hodge.co_gradients, "co-gradient")}.`)
      : h("p", {}, `${plural(eigenvalues.length, "eigenpair")} of ${laplacian}${reason}.`),
  ];
  if (proof.accuracy) {
    const { goal, largest_estimate, reached } = proof.accuracy;
    sentences.push(reached
      ? h("p", {}, `Values are estimated to be off by ${percent(largest_estimate)} at most; the goal was ${percent(goal)}.`)
      : h("p", { class: "unproven" }, `Values are estimated to be off by up to ${percent(largest_estimate)}, more than the goal of ${percent(goal)}.`));
  } else {
    sentences.push(h("p", {}, `Every pair has a residual of at most ${brief(worst)}${proof.tolerance ? ` (asked: ${brief(proof.tolerance)})` : ""}.`));
  }
  if (relative.length) {
    const which = proof.accuracy && proof.complete ? "The exact eigenvalue of the same index" : "For each value an exact eigenvalue of the discrete problem";
    sentences.push(h("p", {}, `${which} lies within its bound: ${percent(relative[relative.length >> 1])} in the median, ${percent(relative[relative.length - 1])} at worst.`));
  }
  if (proof.complete === true) {
    const last = proof.inertia[proof.inertia.length - 1];
    // Fields are counted by the functions that they come from.
    const counts = last ? plural(proof.inertia.length, "inertia count") : "inertia counts in two scalar spectra";
    sentences.push(h("p", { class: "proven" }, `Proven complete: ${counts.replace(/^1 /, "an ")} show${proof.inertia.length === 1 ? "s" : ""} that no eigenvalue was skipped${last ? `; below ${brief(last.shift)} there are exactly ${grouped(last.below)}` : ""}.`));
  } else if (proof.complete === false) sentences.push(h("p", { class: "unproven" }, "Not proven complete: an eigenvalue may be missing."));
  else sentences.push(h("p", {}, "The approximate method counts whether an eigenvalue was skipped only where it is asked to certify; the exact method always does."));
  sentences.push(h("p", {}, `The eigenfunctions are orthonormal to ${brief(proof.orthonormality_defect)}.`));
  const solved = basis.stage_seconds.reduce((sum, stage) => sum + stage.seconds, 0);
  sentences.push(h("p", { class: "dim" }, `Solved in ${seconds(solved)}${parameters.method ? ` by the method ${parameters.method}` : ""}.`));
  return h("div", { class: "certificate" }, ...sentences);
}
