// Geometry from a point: click or drag the dot, and the surface shows distances, signatures or what is similar.

import { postNumbers, recent, type Basis } from "../api";
import type { App, Panel } from "../app";
import type { Request } from "../code";
import { brief, choice, field, grouped, h, plural, slider } from "../dom";
import { latest } from "../latest";
import type { Hit } from "../surface";
import { AXES, type Up } from "../upright";
import { basisHead, eigenForm, ofFunctions } from "./basis";
import { diverging, sequential, type Look } from "./look";

interface Wish {
  basis: Basis;
  vertex: number;
  what: string;
  /** Where between the shortest and the longest time, from 0 to 1. */
  scale: number;
  /** Which function of a series. */
  index: number;
}

/** What an address keeps. */
interface State {
  what: string;
  vertex: number | null;
  time: number;
  index: number;
}

const TITLES: Record<string, string> = {
  diffusion: "Diffusion distance",
  biharmonic: "Biharmonic distance",
  commute_time: "Commute-time distance",
  geodesic: "Geodesic distance",
  exact: "Exact geodesic distance",
  heat_kernel: "Heat kernel signature",
  wave_kernel: "Wave kernel signature",
  global_point: "Global point signature",
  similar: "Similar points",
};
const NOTES: Record<string, string> = {
  diffusion: "How differently heat spreads from two points: close ways count, short cuts do not.",
  biharmonic: "Near the point like geodesic distance, far away aware of the whole shape.",
  commute_time: "How long a random walk takes there and back.",
  geodesic: "The shortest way along the surface, by the heat method on the mesh.",
  exact: "The shortest way along the faces, without an error but that of rounding. It takes longer.",
  heat_kernel: "How much heat stays where it was: high on tips. It needs no point; poses do not change it.",
  wave_kernel: "How likely a particle of some energy is found here: high energies see fine detail. It needs no point.",
  global_point: "An eigenfunction over the root of its eigenvalue; all of them together place each point in a space where bending does not matter.",
  similar: "Points whose heat kernels over all times are like that of the dot: yellow is alike.",
};
/** What depends on a time. */
const TIMED = ["diffusion", "heat_kernel"];
/** What has several functions at once, how many, and what the slider over them is called. */
const SERIES: Record<string, { count: number; label: string }> = { wave_kernel: { count: 32, label: "Energy" }, global_point: { count: 20, label: "Function" } };
/** What depends on a point. */
const POINTED = ["diffusion", "biharmonic", "commute_time", "geodesic", "exact", "similar"];

/** What goes along faces. */
const ALONG = ["geodesic", "exact"];

export function pointsPanel(app: App, look: Look): Panel {
  const head = basisHead(app, () => panel, "basis", eigenForm(app, look));
  const body = h("div", { hidden: true });
  const note = h("p", { class: "dim" });
  const timing = h("p", { class: "dim" });
  let vertex: number | null = null;
  let what = "geodesic";

  const times = (basis: Basis, scale: number) => {
    const values = basis.eigenvalues;
    const last = values[values.length - 1];
    // Of a basis of constants alone there is no time; the server says why.
    const first = values.find((value) => value > 1e-8 * last);
    if (first === undefined) return 1;
    const [short, long] = [1 / last, 2 / first];
    return short * (long / short) ** scale;
  };

  let series: { of: string; values: Float32Array; request: Request | null } | null = null;
  /** One function of a series; the whole series is asked for once. */
  const member = async (basis: Basis, what: string, index: number) => {
    const { count } = SERIES[what];
    const of = `${basis.id} ${what}`;
    if (series?.of !== of) {
      // The kernel has no point signature: a constant for each component.
      const most = what === "global_point" ? Math.max(basis.count - (app.mesh?.report.components ?? 1), 1) : count;
      const values = await postNumbers(`${basis.links.self}/signatures`, { signature: { kind: what, count: Math.min(count, most) } });
      series = { of, values, request: recent.shown };
    }
    recent.shown = series.request;
    const columns = series.values.length / basis.vertices;
    const chosen = Math.min(index, columns - 1);
    return Float32Array.from({ length: basis.vertices }, (_, v) => series!.values[v * columns + chosen]);
  };
  const send = latest<Wish>(async ({ basis, vertex, what, scale, index }) => {
    const begin = performance.now();
    const to = basis.links.self;
    const time = times(basis, scale);
    let values: Float32Array;
    if (what === "heat_kernel") values = await postNumbers(`${to}/signatures`, { signature: { kind: "heat_kernel", times: [time] } });
    else if (SERIES[what]) values = await member(basis, what, index);
    else if (what === "similar") values = await postNumbers(`${to}/similar-points`, { vertex, signature: { kind: "heat_kernel" } });
    else values = await postNumbers(`${to}/distances`, { distance: what === "diffusion" ? { kind: what, times: [time] } : what === "exact" ? { kind: "geodesic", method: "exact" } : { kind: what }, sources: [vertex] });
    if (app.basis !== basis || app.panel !== panel) return;
    timing.textContent = `${brief(performance.now() - begin)} ms for ${grouped(values.length)} values`;
    const apart = values.filter((value) => !Number.isFinite(value)).length;
    if (apart > 0) timing.textContent += `. No way leads to ${plural(apart, "vertex", "vertices")}: other components of the surface have no colour.`;
    if (what === "similar") {
      const shown = sequential(values.map((value) => -value));
      const sorted = shown.values.slice().sort();
      look.show({ ...shown, range: [sorted[sorted.length >> 1], 0] }, ["different", "alike"]);
    } else if (what === "global_point") look.show(diverging(values));
    else look.show(sequential(values, what === "heat_kernel" ? 0.995 : 1));
    document.body.dataset.field = `${what} ${vertex}`;
  }, (error) => {
    app.fail(error);
    if (app.panel !== panel) return;
    // Colours of before would stand under the name of what could not be had.
    look.show(null);
    timing.textContent = "";
    delete document.body.dataset.field;
  });

  const ask = () => {
    const basis = app.basis;
    time.element.hidden = !TIMED.includes(what);
    which.element.hidden = !SERIES[what];
    if (SERIES[what]) {
      which.element.firstElementChild!.textContent = SERIES[what].label;
      which.control.max = String(SERIES[what].count - 1);
      which.set(Math.min(which.control.valueAsNumber, SERIES[what].count - 1));
    }
    note.textContent = NOTES[what];
    app.title.textContent = TITLES[what];
    if (!basis) return;
    app.keep({ what, vertex, time: time.control.valueAsNumber, index: which.control.valueAsNumber } satisfies State);
    const shown = POINTED.includes(what);
    app.viewer.mark("source", shown ? vertex : null);
    if (vertex === null && shown) return;
    send({ basis, vertex: vertex ?? 0, what, scale: time.control.valueAsNumber, index: which.control.valueAsNumber });
  };
  const time = slider("Time", { min: 0, max: 1, step: 0.01, value: 0.45 }, ask, (value) => (app.basis ? brief(times(app.basis, value)) : ""));
  const which = slider("Energy", { min: 0, max: 31, step: 1, value: 8 }, ask);
  const kinds = choice(Object.entries(TITLES), what, (value) => {
    what = value;
    ask();
  });
  const move = (hit: Hit) => {
    vertex = hit.vertex;
    ask();
  };
  body.append(field("Show", kinds), note, time.element, which.element, h("p", {}, "Click the surface to move the dot, or drag the dot."), timing);

  const panel: Panel = {
    id: "points",
    title: "Distances",
    about: "How far apart points are, and which of them look alike, by measures that bending does not change.",
    guide: "distances",
    kind: "eigenbasis",
    fits: ofFunctions,
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      body.hidden = app.basis === null;
      if (!app.basis || !app.viewer.surface) {
        look.show(null);
        return;
      }
      body.append(look.element);
      const state = app.arrived<Partial<State>>("points");
      if (state?.what && Object.hasOwn(TITLES, state.what)) kinds.value = what = state.what;
      // There is no way along a surface where there are no faces.
      else if (app.mesh?.report.points && ALONG.includes(what)) kinds.value = what = "biharmonic";
      if (typeof state?.vertex === "number" && state.vertex >= 0 && Number.isInteger(state.vertex)) vertex = state.vertex;
      if (typeof state?.index === "number") which.set(state.index);
      time.set(typeof state?.time === "number" ? state.time : time.control.valueAsNumber);
      const count = app.viewer.surface.positions.length / 3;
      if (vertex === null || vertex >= count) vertex = farthestUp(app.viewer.surface.positions, app.viewer.up);
      app.viewer.onClick = move;
      app.viewer.onStroke = (hit, phase) => {
        if (phase === "begin" && (vertex === null || apart(app.viewer.surface!.positions, hit.vertex, vertex) > 0.06 * app.viewer.radius)) return false;
        move(hit);
        return true;
      };
      ask();
    },
    hide() {
      app.viewer.mark("source", null);
      app.viewer.onClick = app.viewer.onStroke = null;
      delete document.body.dataset.field;
    },
  };
  app.on("mesh", () => (vertex = null));
  return panel;
}

/** A vertex to begin with: the uppermost. */
function farthestUp(positions: Float32Array, up: Up): number {
  const [axis, sign] = AXES[up][1];
  let best = 0;
  for (let v = 0; v < positions.length / 3; v++) if (sign * positions[3 * v + axis] > sign * positions[3 * best + axis]) best = v;
  return best;
}

const apart = (positions: Float32Array, a: number, b: number) =>
  Math.hypot(positions[3 * a] - positions[3 * b], positions[3 * a + 1] - positions[3 * b + 1], positions[3 * a + 2] - positions[3 * b + 2]);
