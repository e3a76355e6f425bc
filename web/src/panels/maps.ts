// Functional maps: two surfaces side by side, points that correspond are clicked, and the map between them is shown as it changes.

import { ApiError, get, numbers, post, recent, type Basis, type BasisSummary, type Mesh, type Page } from "../api";
import type { App, Panel } from "../app";
import type { Request } from "../code";
import { Beside } from "../beside";
import { carried, gathered, numberedPairs, placeColours, type FunctionalMap } from "../correspondence";
import { brief, choice, field, grouped, h, refill, slider } from "../dom";
import { fileName, give, write } from "../give";
import { latest } from "../latest";
import { colourOf, showPins } from "../pins";
import { Plot } from "../plot";
import type { Hit } from "../surface";
import { UPWARD, type Up } from "../upright";
import { paintMatrix } from "./matrix";
import { basisHead, eigenForm, line, ofFunctions, operatorOf } from "./basis";
import { diverging, type Look } from "./look";

/** What an address keeps: the other mesh, landmarks, sizes, and what is shown. */
interface State {
  other: string;
  /** The basis on the other surface, where it was chosen. */
  basis?: string;
  pairs: [number, number][];
  signatures: boolean;
  start: number;
  size: number;
  shown: string;
  mode: number;
}

interface Wish {
  turn: number;
  source: Basis;
  target: BasisSummary;
  pairs: [number, number][];
  signatures: boolean;
  start: number;
  size: number;
}

/** Pairs of a basis that is computed where one is missing. */
const PAIRS = 120;
/** Checks along the longest extent. */
const CHECKS = 14;

const SHOWN: [string, string][] = [["colours", "colours by place"], ["checks", "a texture of checks"], ["mode", "a mode"], ["confidence", "confidence"]];

export function mapsPanel(app: App, look: Look, stage: HTMLElement): Panel {
  const head = basisHead(app, () => panel, "basis", eigenForm(app, look));
  const body = h("div", {});
  const note = h("p", { class: "dim", "aria-live": "polite" });
  const facts = h("dl", { class: "facts-list wide" });
  let beside: Beside | null = null;
  let theirs: BasisSummary | null = null;
  let wantedBasis: string | undefined;
  let pairs: [number, number][] = [];
  let half: { left: boolean; vertex: number } | null = null;
  let found: { answer: FunctionalMap; request: Request | null } | null = null;
  let turn = 0;
  let refining: AbortController | null = null;
  let shown = "colours";
  /** Kept while the surfaces change sides: what the tab is to show once the named mesh is open. */
  let next: { mesh: string; state: Partial<State> } | null = null;

  const here = () => app.panel === panel && app.mesh !== null;
  /** The other surface; the open one is none. */
  const other = () => (beside?.mesh && beside.mesh.id !== app.mesh?.id ? beside.mesh : null);

  // --- the map --------------------------------------------------------------------------------------------------------------

  const ask = ({ source, target, pairs, signatures }: Wish, start: number, size: number, signal?: AbortSignal) =>
    post<FunctionalMap>("/v1/functional-maps", { source: source.id, target: target.id, landmarks: pairs, signatures: signatures || pairs.length === 0, start, pairs: size, all_points: true }, { signal });
  // A first map at once, and after it, as long as nothing changes, the refined one.
  const quick = latest<Wish>(async (wish) => {
    const [answer, request] = [ask(wish, wish.start, wish.start), recent.shown];
    const map = { answer: await answer, request };
    if (wish.turn !== turn || !here()) return;
    found = map;
    tell();
    if (wish.size > wish.start) refine(wish);
    else done();
  }, (error) => failed(error));
  const refine = latest<Wish>(async (wish) => {
    if (wish.turn !== turn) return;
    refining = new AbortController();
    const begin = performance.now();
    note.textContent = `Refining to ${wish.size} pairs …`;
    const [answer, request] = [ask(wish, wish.start, wish.size, refining.signal), recent.shown];
    const map = { answer: await answer, request };
    if (wish.turn !== turn || !here()) return;
    found = map;
    tell();
    note.textContent = `Refined to ${wish.size} pairs in ${brief((performance.now() - begin) / 1000)} s.`;
    done();
  }, (error) => failed(error));
  const done = () => (document.body.dataset.mapped = String(turn));
  /** What is under way is of no use any more. */
  const abandon = () => {
    turn += 1;
    refining?.abort();
    delete document.body.dataset.mapped;
  };
  const update = () => {
    abandon();
    keep();
    marks();
    if (!here() || !app.basis || !theirs || !other()) return;
    const most = Math.min(app.basis.count, theirs.count);
    const first = Math.min(start.control.valueAsNumber, most);
    note.textContent = "";
    quick({ turn, source: app.basis, target: theirs, pairs: pairs.slice(), signatures: signatures.checked, start: first, size: Math.max(Math.min(size.control.valueAsNumber, most), first) });
  };

  // --- what is shown --------------------------------------------------------------------------------------------------------

  const modes = latest<{ basis: Basis; mode: number }>(async ({ basis, mode }) => {
    const values = await numbers(`${basis.links.modes}?from=${mode}&to=${mode + 1}&format=f32`);
    if (!here() || app.basis !== basis) return;
    // What “Save” copies stays the map.
    recent.shown = found?.request ?? null;
    if (shown !== "mode") return;
    const scalar = diverging(values);
    look.show(scalar);
    if (found && beside) beside.viewer.setScalar({ ...scalar, range: look.range!, values: carried(found.answer.points, values) });
    document.body.dataset.carried = `mode ${mode}`;
  }, app.fail);
  const plain = () => {
    for (const viewer of [app.viewer, beside?.viewer]) {
      viewer?.tint(null);
      viewer?.setScalar(null);
    }
  };
  const show = () => {
    const surface = app.viewer.surface;
    mode.element.hidden = shown !== "mode";
    look.element.hidden = shown === "colours" || shown === "checks";
    if (!surface || !beside?.viewer.surface) return;
    beside.viewer.map(look.map);
    // A plateau at 1 is no place for lines.
    for (const viewer of [app.viewer, beside.viewer]) viewer.lines(shown === "confidence" ? 0 : (app.place.lines ?? 16));
    if (!found || found.answer.points.length !== beside.viewer.surface.positions.length / 3) {
      look.show(null);
      return plain();
    }
    const { points, confidences } = found.answer;
    if (shown === "mode") {
      plain();
      if (app.basis) modes({ basis: app.basis, mode: Math.min(mode.control.valueAsNumber, app.basis.count - 1) });
      return;
    }
    if (shown === "confidence") {
      plain();
      const range: [number, number] = [0, 1];
      look.show({ values: gathered(found.answer, surface), range, diverging: false });
      beside.viewer.map(look.map);
      beside.viewer.setScalar({ values: Float32Array.from(confidences, (value) => value ?? 0), range: look.range!, diverging: false });
    } else {
      look.show(null);
      const colours = placeColours(surface);
      const checks = shown === "checks" ? CHECKS : 0;
      app.viewer.tint(colours, checks);
      beside.viewer.tint(carried(points, colours, 3), checks);
    }
    document.body.dataset.carried = shown;
  };
  const tell = () => {
    if (!found) return;
    const { answer } = found;
    const confident = answer.confidences.filter((value) => value !== null).sort((a, b) => a - b);
    const rows: [string, string, string][] = [
      ["Size", `${answer.matrix.columns} × ${answer.matrix.columns}`, "Rows and columns of the map"],
      ["Areas", brief(answer.orthogonality_defect), "‖CᵀC − I‖ / √k: 0 where areas are kept"],
      ["Isometry", brief(answer.commutativity_defect), "‖CΛ − Λ′C‖ / ‖CΛ‖: 0 for an isometry"],
      ["Embedding", brief(answer.embedding_error), "Distance of matched points in the spectral embedding, over its size"],
      ["Coverage", `${Math.round(100 * answer.coverage)} %`, "The share of this surface that was matched with"],
      ["Confidence", brief(confident[confident.length >> 1] ?? 0), "Median over the other surface; 1 is certain"],
    ];
    facts.replaceChildren(...rows.map(([name, value, title]) => h("div", { title }, h("dt", {}, name), h("dd", {}, value))));
    matrix.canvas.hidden = files.hidden = false;
    matrix.draw();
    show();
  };
  const matrix = new Plot(230, "The functional map as a matrix: blue below zero, orange above", (frame) => found && paintMatrix(frame, found.answer.matrix));

  // --- landmarks ------------------------------------------------------------------------------------------------------------

  const list = h("ol", { class: "landmarks", "aria-label": "Landmarks" });
  const marks = () => {
    if (!beside) return;
    const of = (left: boolean) => [
      ...pairs.map(([a, b], k) => ({ vertex: left ? a : b, text: String(k + 1), colour: colourOf(k) })),
      ...(half?.left === left ? [{ vertex: half.vertex, text: String(pairs.length + 1), colour: colourOf(pairs.length) }] : []),
    ];
    showPins(app.viewer, of(true));
    showPins(beside.viewer, of(false));
    list.replaceChildren(...pairs.map(([a, b], k) => {
      const mark = h("span", { class: "number" }, String(k + 1));
      mark.style.background = colourOf(k);
      return h("li", {}, mark, h("span", {}, `${grouped(a)} ↔ ${grouped(b)}`), h("button", { class: "quiet", "aria-label": `Remove landmark ${k + 1}`, onclick: () => {
        pairs = pairs.filter((_, other) => other !== k);
        update();
        (list.children[Math.min(k, pairs.length - 1)]?.querySelector("button") ?? app.viewer.canvas).focus({ preventScroll: true });
      } }, "×"));
    }));
    hint.textContent = half
      ? `Now click the same point on ${half.left ? "the other surface" : "this surface"}, or another one here.`
      : pairs.length ? "Click another point, then the same one on the other surface." : "Click a point on one surface, then the same point on the other. Without landmarks, heat kernels alone are matched: left and right may be swapped.";
    // A button that is of no use any more gives the focus to where the next landmark is set.
    if (pairs.length === 0 && half === null && [undo, clear].some((button) => button === document.activeElement)) app.viewer.canvas.focus({ preventScroll: true });
    undo.disabled = clear.disabled = pairs.length === 0 && half === null;
  };
  const hint = h("p", { "aria-live": "polite" });
  const click = (left: boolean) => (hit: Hit) => {
    if (half && half.left !== left) {
      pairs = [...pairs, left ? [hit.vertex, half.vertex] : [half.vertex, hit.vertex]];
      half = null;
      update();
    } else {
      half = { left, vertex: hit.vertex };
      marks();
    }
  };
  const undo = h("button", { onclick: () => {
    if (half) {
      half = null;
      marks();
    } else {
      pairs = pairs.slice(0, -1);
      update();
    }
  } }, "Undo");
  const clear = h("button", { onclick: () => {
    [pairs, half] = [[], null];
    update();
  } }, "Clear");

  // --- the two surfaces -----------------------------------------------------------------------------------------------------

  const keep = () => {
    const mesh = other();
    if (!here() || !mesh) return;
    const state: State = { other: mesh.id, basis: wantedBasis, pairs, signatures: signatures.checked, start: start.control.valueAsNumber, size: size.control.valueAsNumber, shown, mode: mode.control.valueAsNumber };
    app.keep(state);
  };
  const chooser = h("div", {});
  const missing = h("button", { class: "primary", hidden: true, onclick: () => {
    const mesh = other();
    if (!app.basis) void app.submit("eigenbasis", { count: PAIRS });
    if (!theirs && mesh) void app.submit("eigenbasis", { count: PAIRS }, mesh.id);
  } }, `Compute ${PAIRS} pairs where there are none`);
  const needs = () => {
    const mesh = other();
    missing.hidden = mesh === null || (app.basis !== null && theirs !== null);
    tools.hidden = mesh === null || !missing.hidden;
    numberingField.hidden = !renumbered();
  };
  const findTheirs = async () => {
    const mesh = other();
    if (!mesh) return;
    const page = await get<Page<BasisSummary>>(`/v1/bases?mesh=${mesh.id}&kind=eigenbasis&limit=200`);
    // A mesh that was deleted has no bases either.
    if (page.items.length === 0) await get(`/v1/meshes/${mesh.id}`);
    if (mesh !== other()) return;
    // Unless one is chosen, the largest of those of the same operator: functions of different operators do not correspond.
    const offered = page.items.filter(ofFunctions).sort((a, b) => Number(alike(b)) - Number(alike(a)) || b.count - a.count);
    const best = offered.find(({ id }) => id === wantedBasis) ?? offered[0] ?? null;
    const changed = best?.id !== theirs?.id;
    theirs = best;
    refill(basisThere, ...(offered.length > 1 ? [field("Its basis", choice(offered.map((basis) => [basis.id, line(basis)]), best!.id, (id) => {
      wantedBasis = id;
      findTheirs().catch(failed);
    }), "The basis on the other surface")] : []));
    needs();
    if (changed) update();
  };
  const alike = (basis: BasisSummary) => app.basis !== null && operatorOf(basis) === operatorOf(app.basis);
  const basisThere = h("div", {});
  /** Takes the other surface away. */
  const leave = () => {
    abandon();
    [pairs, half, found, theirs] = [[], null, null, null];
    beside?.drop();
    blank();
    if (!here()) return;
    plain();
    look.show(null);
    marks();
    offer();
    needs();
    app.keep(null);
  };
  const missed = (error: unknown) => error instanceof ApiError && error.problem.status === 404;
  /** Tells an error; if it is that the other mesh or its basis was deleted meanwhile, the page forgets it too. */
  const failed = (error: unknown) => {
    app.fail(error);
    const mesh = other();
    if (!mesh || !missed(error)) return;
    get(`/v1/meshes/${mesh.id}`).then(findTheirs, (gone: unknown) => {
      if (!missed(gone)) throw gone;
      if (other() === mesh) leave();
      return app.list();
    }).catch(app.fail);
  };
  /** Nothing is known of a map. */
  const blank = () => {
    basisThere.replaceChildren();
    facts.replaceChildren();
    note.textContent = "";
    matrix.canvas.hidden = files.hidden = true;
  };
  const choose = async (id: string) => {
    if (!beside) {
      app.beside = beside = new Beside(app, stage);
      beside.viewer.onClick = click(false);
    }
    const mesh = app.meshes.find((mesh) => mesh.id === id) ?? (await get<Mesh>(`/v1/meshes/${id}`));
    if (other()?.id !== id) {
      abandon();
      [found, theirs] = [null, null];
      blank();
    }
    if (!(await beside.load(mesh)) || !here()) return;
    beside.show(true);
    beside.viewer.onClick = click(false);
    // An address may name vertices that there are not.
    const counts = [app.viewer, beside.viewer].map(({ resting }) => (resting?.length ?? 0) / 3);
    pairs = pairs.filter((pair) => pair.every((vertex, side) => vertex < counts[side]));
    upThere.value = beside.viewer.up;
    offer();
    marks();
    needs();
    await findTheirs();
    if (found) show();
    keep();
  };
  const offer = () => {
    const mesh = other();
    const meshes = app.meshes.filter(({ id }) => id !== app.mesh?.id);
    if (mesh && !meshes.some(({ id }) => id === mesh.id)) meshes.push(mesh);
    if (meshes.length === 0) {
      chooser.replaceChildren(h("p", {}, "Another surface is needed: drop a second mesh on the page, another pose of this one for instance."));
      return;
    }
    const select = choice([["", "choose one …"], ...meshes.map(({ id, name, vertices }): [string, string] => [id, `${name ?? id.slice(0, 8)} · ${grouped(vertices)}`])], mesh && here() ? mesh.id : "", (id) => {
      if (!id) return leave();
      [pairs, half] = [[], null];
      choose(id).catch(failed);
    });
    refill(chooser, field("Other", select, "The other surface"));
  };
  const swap = h("button", { title: "The other surface becomes the one that functions come from", onclick: () => {
    const [mesh, before] = [other(), app.mesh];
    if (!mesh || !before) return;
    next = { mesh: mesh.id, state: { other: before.id, pairs: pairs.map(([a, b]) => [b, a]) } };
    app.open(mesh.id).catch(app.fail);
  } }, "Swap sides");

  // --- controls -------------------------------------------------------------------------------------------------------------

  const signatures = h("input", { type: "checkbox", checked: true, onchange: () => update() });
  const start = slider("Start at", { min: 5, max: 60, step: 1, value: 20 }, () => {});
  const size = slider("Refine to", { min: 20, max: 200, step: 5, value: 60 }, () => {});
  for (const { control } of [start, size]) control.addEventListener("change", update);
  const kinds = choice(SHOWN, shown, (value) => {
    shown = value;
    keep();
    show();
  });
  const mode = slider("Mode", { min: 1, max: 60, step: 1, value: 7 }, () => {
    keep();
    show();
  });
  const linked = h("input", { type: "checkbox", checked: true, onchange: () => {
    if (!beside) return;
    beside.linked = linked.checked;
    if (linked.checked) beside.viewer.follow(app.viewer);
  } });
  const upThere = choice(UPWARD, "y", (axis) => {
    if (beside) beside.viewer.up = axis as Up;
  });
  const renumbered = () => [app.mesh, other()].some((mesh) => mesh?.report.file);
  const numbering = choice([["kept", "of the kept meshes"], ["file", "of the files"]], "kept", () => {});
  const take = async (kind: "csv" | "npy" | "ply") => {
    const mesh = other();
    if (!found || !mesh || !app.mesh || !beside) return;
    const name = fileName(app.mesh.name, "to", mesh.name);
    if (kind === "ply") {
      const surface = beside.viewer.shape()!;
      const colours = Uint8Array.from(carried(found.answer.points, placeColours(app.viewer.surface!), 3), (part) => Math.round(31 + 216 * part));
      return give(await write({ kind: "ply", surface, shown: { values: Float32Array.from(found.answer.confidences, (value) => value ?? 0), colours } }), `${name}.ply`);
    }
    const which = renumbered() ? numbering.value : "";
    const { points, confidences } = await numberedPairs(found.answer, app.mesh, mesh, which === "file");
    const blob = kind === "csv" ? await write({ kind: "pairs", points, confidences, numbering: which === "kept" ? "kept_vertex" : "vertex" }) : await write({ kind: "npy", values: points });
    give(blob, `${name}.${kind}`);
  };
  const numberingField = field("Numbering", numbering, "Repairs dropped or merged vertices of one of the files");
  const button = (text: string, kind: "csv" | "npy" | "ply", title: string) => h("button", { title, onclick: () => take(kind).catch(app.fail) }, text);
  const files = h("div", { hidden: true }, h("h3", {}, "Correspondence"), numberingField, h("div", { class: "row wrap" },
    button("CSV", "csv", "For each vertex of the other surface that of this one, and the confidence"),
    button("NPY", "npy", "The same as int32 for NumPy, −1 where a vertex has none"),
    button("PLY, coloured", "ply", "The other surface with the colours that were carried to it, and the confidence as value")));
  const tools = h("div", { hidden: true }, hint, list, h("div", { class: "row" }, undo, clear),
    field("Show", kinds), mode.element, look.element, h("label", { class: "row" }, signatures, "also match heat kernels"), start.element, size.element, note, facts, matrix.canvas, files);
  matrix.canvas.hidden = true;
  body.append(chooser, basisThere, missing, h("div", { class: "row wrap" }, h("label", { class: "row" }, linked, "link the cameras"), swap), field("Its up axis", upThere), tools);

  app.on("meshes", () => here() && offer());
  app.on("map", () => here() && show());
  app.on("jobs", () => {
    const mesh = other();
    if (!here() || !mesh || theirs) return;
    if (app.jobs.list.some((job) => job.mesh === mesh.id && job.kind === "eigenbasis" && job.status === "succeeded")) findTheirs().catch(failed);
  });
  app.on("mesh", () => {
    [pairs, half, found] = [[], null, null];
    blank();
  });
  // The mesh that was deleted may be the one that stood beside others.
  app.on("meshes", () => beside?.mesh && app.gone.has(beside.mesh.id) && leave());

  const panel: Panel = {
    id: "maps",
    title: "Maps",
    about: "Which point of another surface belongs to which of this one: a few landmarks make a map that carries functions, colours and textures over.",
    guide: "functional-maps",
    kind: "eigenbasis",
    fits: ofFunctions,
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      body.hidden = app.mesh === null;
      app.title.textContent = app.mesh?.name ?? "";
      look.show(null);
      if (!app.mesh) return;
      tools.insertBefore(look.element, mode.element.nextSibling);
      app.viewer.onClick = click(true);
      const wish = next?.mesh === app.mesh.id ? next.state : app.arrived<State>("maps");
      next = null;
      if (wish) adopt(wish);
      const wanted = typeof wish?.other === "string" ? wish.other : other()?.id;
      offer();
      needs();
      if (wanted && wanted !== app.mesh.id) choose(wanted).then(() => update()).catch(failed);
      else beside?.show(false);
    },
    hide() {
      abandon();
      look.element.hidden = false;
      app.viewer.tint(null);
      app.viewer.lines(app.place.lines ?? 16);
      app.viewer.overlay("pins", null);
      app.viewer.onClick = null;
      beside?.show(false);
      delete document.body.dataset.carried;
    },
  };
  /** Takes over what an address says, as far as it makes sense. */
  const adopt = (state: Partial<State>) => {
    const whole = (value: unknown) => Number.isInteger(value) && (value as number) >= 0;
    wantedBasis = typeof state.basis === "string" ? state.basis : undefined;
    if (Array.isArray(state.pairs)) pairs = state.pairs.filter((pair) => Array.isArray(pair) && pair.length === 2 && pair.every(whole));
    if (typeof state.signatures === "boolean") signatures.checked = state.signatures;
    if (whole(state.start)) start.set(state.start!);
    if (whole(state.size)) size.set(state.size!);
    if (whole(state.mode)) mode.set(state.mode!);
    if (SHOWN.some(([name]) => name === state.shown)) kinds.value = shown = state.shown!;
  };
  return panel;
}
