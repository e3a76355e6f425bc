// Two bases of one surface, compared: how far their spaces are turned, and how far their eigenvalues are apart.

import { post, type Basis } from "../api";
import type { App } from "../app";
import { brief, choice, field, h, plural, power, refill } from "../dom";
import type { components } from "../openapi";
import { Plot, type Frame } from "../plot";
import { paintMatrix } from "./matrix";

type Comparison = components["schemas"]["BasisComparisonAnswer"];

/** Coefficients are drawn of so many pairs at most. */
const DRAWN = 150;
const LEFT = 46, RIGHT = 8;

export function comparison(app: App, name: (id: string) => string): { element: HTMLElement; update: () => void } {
  const chooser = h("div", {});
  const result = h("div", { hidden: true });
  const summary = h("p", { "aria-live": "polite" });
  let found: { of: string; answer: Comparison } | null = null;
  const plot = new Plot(170, "Errors of the eigenspaces and of the eigenvalues, mode by mode, on a logarithmic scale", (frame) => found && paint(frame, found.answer));
  const table = new Plot(230, "Fourier coefficients of one basis in the other", (frame) => found?.answer.coefficients && paintMatrix(frame, found.answer.coefficients));
  result.append(summary, plot.canvas, h("h3", {}, "Coefficients"), table.canvas, h("p", { class: "dim" }, "A row for each mode of the reference, a column for each of this basis. Blocks on the diagonal are clusters, within which single functions mean nothing."));
  let reference = "";
  const clear = () => {
    found = null;
    result.hidden = true;
    delete document.body.dataset.compared;
  };
  const run = async () => {
    const [basis, chosen] = [app.basis, reference];
    clear();
    if (!basis || !chosen) return;
    const answer = await post<Comparison>("/v1/basis-comparisons", { reference: chosen, other: basis.id, pairs: Math.min(DRAWN, basis.count, app.bases.find(({ id }) => id === chosen)?.count ?? DRAWN), coefficients: true });
    if (app.basis !== basis || reference !== chosen) return;
    found = { of: basis.id, answer };
    const spaces = answer.eigenspaces.filter(({ to }) => to < answer.pairs);
    const worst = spaces.reduce((most, space) => (space.error > most.error ? space : most), { error: 0, from: 0, to: 1 });
    const values = answer.eigenvalue_errors.slice(1).map(Math.abs).filter(Number.isFinite);
    const largest = answer.angles[answer.angles.length - 1] ?? 0;
    summary.textContent = `${plural(answer.pairs, "pair")} in ${plural(answer.eigenspaces.length, "eigenspace")}: eigenvalues differ by up to ${brief(100 * Math.max(...values, 0))} %, and the eigenspace of ${worst.to - worst.from === 1 ? `mode ${worst.from}` : `modes ${worst.from} to ${worst.to - 1}`} is turned most, sin θ = ${brief(worst.error)}. Of all functions together the largest principal angle is ${brief((180 / Math.PI) * largest)}°; it says how the last cluster is cut.`;
    result.hidden = false;
    plot.draw();
    table.draw();
    document.body.dataset.compared = String(answer.pairs);
  };
  const element = h("details", { class: "new" }, h("summary", {}, "Compare with another basis …"), chooser, result);
  const update = () => {
    const basis: Basis | null = app.basis;
    if (found?.of !== basis?.id) clear();
    const others = app.bases.filter((other) => basis && other.kind === "eigenbasis" && other.id !== basis.id && rows(other) === rows(basis));
    element.hidden = others.length === 0;
    if (!others.some(({ id }) => id === reference) || !found) reference = "";
    refill(chooser, field("Reference", choice([["", "choose one …"], ...others.map(({ id }): [string, string] => [id, name(id)])], reference, (id) => {
      reference = id;
      run().catch(app.fail);
    }), "Take the exact one, where there is one"));
  };
  return { element, update };
}

/** Bases are compared on as many rows: functions with functions, fields with fields. */
const rows = (basis: { rows?: number | null; vertices: number }) => basis.rows ?? basis.vertices;

function paint({ context: c, width, height, ink, faint, accent, second, write }: Frame, { pairs, eigenspaces, eigenvalue_errors }: Comparison) {
  const [top, bottom] = [18, height - 8];
  const x = (k: number) => LEFT + ((width - LEFT - RIGHT) * k) / Math.max(pairs, 1);
  const log = (value: number) => Math.log10(Math.min(Math.max(Math.abs(value), 1e-12), 1));
  const shown = [...eigenspaces.map(({ error }) => log(error)), ...eigenvalue_errors.slice(1).map(log)].filter(Number.isFinite);
  const low = Math.floor(Math.min(...shown, -1)), high = Math.max(Math.ceil(Math.max(...shown, low + 1)), low + 1);
  const y = (value: number) => bottom - ((bottom - top) * (Math.max(log(value), low) - low)) / (high - low);
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (const exponent of [low, Math.round((low + high) / 2), high]) {
    c.strokeStyle = faint;
    c.beginPath();
    c.moveTo(LEFT, y(10 ** exponent));
    c.lineTo(width - RIGHT, y(10 ** exponent));
    c.stroke();
    c.fillStyle = ink;
    c.fillText(power(exponent), LEFT - 5, y(10 ** exponent));
  }
  c.strokeStyle = accent;
  c.lineWidth = 3;
  for (const { from, to, error } of eigenspaces) {
    c.beginPath();
    c.moveTo(x(from), y(error));
    c.lineTo(x(to) - 1, y(error));
    c.stroke();
  }
  c.fillStyle = second;
  eigenvalue_errors.forEach((error, k) => Number.isFinite(error) && c.fillRect(x(k + 0.5) - 1, y(error) - 1, 2.5, 2.5));
  c.textAlign = "left";
  c.fillStyle = accent;
  c.fillRect(LEFT, 5, 10, 3);
  write("eigenspaces, sin θ", LEFT + 14, 7);
  c.fillStyle = second;
  c.fillRect(LEFT + 124, 5, 3, 3);
  write("eigenvalues", LEFT + 130, 7);
}
