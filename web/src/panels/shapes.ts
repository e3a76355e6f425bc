// Shape-DNA: every stored shape as a point and a small picture; shapes with like spectra stand together. A click opens one.

import { get, post, type BasisSummary, type Mesh, type Page } from "../api";
import type { App, Panel } from "../app";
import { choice, field, grouped, h, plural } from "../dom";
import { Plot, type Frame } from "../plot";
import { Portraits } from "../portrait";
import type { Look } from "./look";

interface Comparison {
  labels: string[];
  count: number;
  places: { columns: number; values: number[] };
  held: number[];
  neighbours: number[][];
}

/** Operators whose spectra are alike: Laplacians of the surface itself. */
const LAPLACIANS = new Set<unknown>(["auto", "laplace", "polygon", "robust"]);
/** The most shapes that are compared here. */
const MOST = 100;
/** Letters of a name in the plot. */
const LONGEST = 22;

export function shapesPanel(app: App, look: Look): Panel {
  let bases: BasisSummary[] = [];
  let found: Comparison | null = null;
  let over = -1;
  let scale = "area";
  const note = h("p", { class: "dim" });
  const portraits = new Portraits(app.viewer, async (id) => app.meshes.find((mesh) => mesh.id === id) ?? get<Mesh>(`/v1/meshes/${id}`));
  const list = h("ul", { class: "near", "aria-label": "Shapes, each with its nearest neighbour" });
  const plot = new Plot(300, "Shapes by their spectra", (frame) => found && paint(frame, found, bases.findIndex((basis) => basis.mesh === app.mesh?.id), over));

  let turn = 0;
  const load = async () => {
    const own = ++turn;
    // One basis for each mesh: the one with most pairs.
    const best = new Map<string, BasisSummary>();
    let from: string | null = null;
    do {
      const page: Page<BasisSummary> = await get(`/v1/bases?kind=eigenbasis&limit=200${from ? `&from=${encodeURIComponent(from)}` : ""}`);
      for (const basis of page.items) {
        if (basis.kind !== "eigenbasis" || basis.parameters.boundary !== "neumann" || !LAPLACIANS.has(basis.parameters.operator)) continue;
        if ((best.get(basis.mesh)?.count ?? 20) < basis.count) best.set(basis.mesh, basis);
      }
      from = page.next;
    } while (from && best.size < MOST);
    const wanted = () => own === turn && app.panel === panel;
    if (!wanted()) return;
    const chosen = [...best.values()].slice(0, MOST);
    if (chosen.length < 3) {
      found = null;
      plot.canvas.hidden = true;
      list.replaceChildren();
      note.textContent = `Three shapes or more can be compared, each with an eigenbasis of more than 20 pairs; ${plural(chosen.length, "shape")} ${chosen.length === 1 ? "has" : "have"} one so far.`;
      return;
    }
    const answer = await post<Comparison>("/v1/shape-comparisons", { bases: chosen.map((basis) => basis.id), scale, dimensions: 2, neighbours: 1 });
    if (!wanted()) return;
    [bases, found] = [chosen, answer];
    plot.canvas.hidden = false;
    const held = Math.round(100 * found.held.slice(0, 2).reduce((sum, part) => sum + part, 0));
    note.textContent = `${plural(bases.length, "shape")} by ${grouped(found.count)} eigenvalues; the plane shows ${held} % of the variance.`;
    const { labels, neighbours } = found;
    list.replaceChildren(...labels.map((label, k) => h("li", {}, h("button", { class: "basis", title: label, onclick: () => open(k) }, bases[k].mesh !== null && portraits.of(bases[k].mesh),
      h("span", { class: "two-lines" }, h("span", {}, label), h("small", {}, neighbours[k].length ? `nearest: ${labels[neighbours[k][0]]}` : ""))))));
    plot.draw();
    document.body.dataset.shapes = String(bases.length);
  };
  const open = (k: number) => {
    const mesh = bases[k]?.mesh;
    if (mesh) app.open(mesh).catch(app.fail);
  };
  const nearest = (event: PointerEvent) => {
    if (!found) return -1;
    const [x, y] = plot.at(event);
    const at = layout(found, plot.canvas.clientWidth, plot.canvas.clientHeight);
    const distances = found.labels.map((_, k) => Math.hypot(at(k)[0] - x, at(k)[1] - y));
    const best = distances.indexOf(Math.min(...distances));
    return distances[best] < 24 ? best : -1;
  };
  plot.canvas.addEventListener("pointermove", (event) => {
    const now = nearest(event);
    if (now !== over) {
      over = now;
      plot.draw();
    }
  });
  plot.canvas.addEventListener("click", (event) => open(nearest(event as PointerEvent)));

  const panel: Panel = {
    id: "shapes",
    title: "Shapes",
    about: "Compare surfaces by their spectra, a fingerprint that neither pose nor triangulation changes.",
    guide: "shape-dna",
    element: h("div", { class: "panel" },
      field("Size", choice([["area", "normalised by area"], ["first", "normalised by λ₁"], ["none", "kept"]], scale, (value) => {
        scale = value;
        load().catch(app.fail);
      })), plot.canvas, note, list),
    show() {
      look.show(null);
      app.title.textContent = app.mesh?.name ?? "";
      load().catch(app.fail);
    },
    hide() {
      delete document.body.dataset.shapes;
    },
  };
  return panel;
}

/** Where each shape stands in a plot; the same scale on both axes, since distances are what counts. */
function layout({ places }: Comparison, width: number, height: number): (k: number) => [number, number] {
  const { columns, values } = places;
  const xs = values.filter((_, i) => i % columns === 0);
  const ys = values.filter((_, i) => i % columns === 1);
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = Math.min((width - 100) / Math.max(right - left, 1e-12), (height - 50) / Math.max(high - low, 1e-12));
  return (k) => [width / 2 + scale * (xs[k] - (left + right) / 2), height / 2 - scale * (ys[k] - (low + high) / 2)];
}

function paint({ context: c, width, height, write, accent, second }: Frame, found: Comparison, here: number, over: number) {
  const at = layout(found, width, height);
  c.textAlign = "center";
  c.textBaseline = "middle";
  // Boxes that are taken: first all dots, then the names as they are written.
  const taken: [x: number, y: number, half: number, high: number][] = found.labels.map((_, k) => [...at(k), 5, 5]);
  // A long name would lie over half of the others; the list under the plot has it in full.
  const names = found.labels.map((label) => (label.length > LONGEST ? `${label.slice(0, LONGEST - 1)}…` : label));
  found.labels.forEach((_, k) => {
    c.fillStyle = k === here ? second : accent;
    c.beginPath();
    c.arc(...at(k), k === here || k === over ? 6 : 4.5, 0, 7);
    c.fill();
  });
  const order = found.labels.map((_, k) => k).sort((a, b) => Number(b === here || b === over) - Number(a === here || a === over));
  for (const k of order) {
    const [x, y] = at(k);
    const half = c.measureText(names[k]).width / 2;
    const middle = Math.min(Math.max(x, half + 2), width - half - 2);
    const free = (v: number) => !taken.some(([p, q, w, h], i) => i !== k && Math.abs(p - middle) < w + half + 3 && Math.abs(q - v) < h + 6);
    // Above or below; names for which there is no room are left out, and pointing at one shows it.
    const row = [y - 13, y + 13].find(free) ?? (k === over || k === here ? y - 13 : undefined);
    if (row === undefined) continue;
    taken.push([middle, row, half, 6]);
    write(names[k], middle, row);
  }
}
