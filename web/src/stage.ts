// What stands over the surface: which way is up, its edges, and everything on the screen as a file.

import { movedSurface } from "./api";
import type { App } from "./app";
import { brief, choice, field, h, slider } from "./dom";
import type { Coloured, Order } from "./files";
import { records } from "./film";
import { fileName, give, write } from "./give";
import type { Look } from "./panels/look";
import { turned } from "./surface";
import { svg } from "./svg";
import { AXES, UPWARD, type Up } from "./upright";

/** Seconds of a film: one turn of the surface. */
const FILM = 6;

export function toolbar(app: App, look: Look): HTMLElement {
  const { viewer } = app;
  const up = choice(UPWARD, "y", (value) => {
    viewer.up = value as Up;
    app.go({ up: value === viewer.guessed ? undefined : (value as Up) });
    app.emit("look");
  }, "Up axis");
  const edges = h("button", { "aria-pressed": "false", title: "Show the edges of the mesh", onclick: () => {
    const on = edges.getAttribute("aria-pressed") !== "true";
    edges.setAttribute("aria-pressed", String(on));
    viewer.edges(on);
  } }, "Edges");
  const slice = slicer(app);
  const menu = h("div", { class: "menu" });
  const save = h("details", { class: "pop save" }, h("summary", {}, "Save"), menu);
  const bar = h("div", { class: "stagebar", role: "group", "aria-label": "View", hidden: true }, up, edges, slice.element, save);

  const renumbered = () => app.mesh?.report.file !== undefined && app.mesh.report.file !== null;
  const name = () => fileName(app.mesh?.name ?? "mesh", app.title.textContent !== app.mesh?.name ? app.title.textContent : "");
  const download = (blob: Blob, ending: string) => give(blob, `${name()}.${ending}`);
  /** Writes a file beside the page, and tells that it is being written where that takes a moment. */
  const file = async (order: Order, ending: string) => writing(ending, () => write(order));
  /** The same of a surface: where its file had texture coordinates, normals or names, the server has kept them and writes it; it knows nothing of colours. */
  const surface = (order: Exclude<Order, { kind: "npy" | "pairs" | "csv" }>, ending: "obj" | "ply" | "glb") => {
    const mesh = app.mesh;
    if (!mesh?.report.attributes || ("shown" in order && order.shown)) return file(order, ending);
    const { positions } = order.kind === "glb" ? turned(order.surface, order.axes) : order.surface;
    return writing(ending, () => movedSurface(mesh.id, positions, ending));
  };
  const writing = async (ending: string, made: () => Promise<Blob>) => {
    const said = window.setTimeout(() => app.working(`Writing ${ending.toUpperCase()} …`), 300);
    try {
      download(await made(), ending);
    } finally {
      window.clearTimeout(said);
      app.working(null);
    }
  };
  const coloured = (): Coloured | null => look.coloured();
  const item = (text: string, act: () => unknown) =>
    h("button", { class: "quiet", onclick: () => {
      save.open = false;
      Promise.resolve().then(act).catch(app.fail);
    } }, text);
  const group = (title: string, items: (HTMLElement | false)[]) => items.some(Boolean) && h("div", {}, h("h3", {}, title), ...items);
  const fill = () => {
    const shown = coloured();
    const { lines, sound, field } = app.kept;
    const groups = [
      group("Picture", [item("PNG", async () => download(await viewer.snapshot(), "png")), records() && item(`Film of a turn, ${FILM} s`, async () => {
        app.toast("note", "Recording", `The surface turns once, for ${FILM} seconds.`);
        const film = await viewer.film(FILM);
        download(film, film.type.includes("mp4") ? "mp4" : "webm");
      }), lines !== null && item("Lines as SVG", async () => {
        const { width, height, runs } = viewer.drawn(lines);
        download(svg(runs, width, height, Math.max(0.6, width / 1200)), "svg");
      })]),
      group("Surface as shown", [item("OBJ", () => surface({ kind: "obj", surface: viewer.shape()! }, "obj")), item(shown ? "PLY with colours" : "PLY", () => surface({ kind: "ply", surface: viewer.shape()!, shown: coloured() }, "ply")),
        item("GLB", () => surface({ kind: "glb", surface: viewer.shape()!, shown: coloured(), axes: AXES[viewer.up] }, "glb")), item("VTP (ParaView)", () => file({ kind: "vtp", surface: viewer.shape()!, shown: coloured() }, "vtp"))]),
      shown && group("Values at the vertices", [item("CSV", () => file({ kind: "csv", surface: viewer.shape()!, shown: coloured()!, vertex: renumbered() ? "kept_vertex" : "vertex" }, "csv")), item("NPY (NumPy)", () => file({ kind: "npy", values: coloured()!.values }, "npy"))]),
      field && group("Field on the faces", [item("Field as NPY", () => file({ kind: "npy", values: field.values, columns: field.columns }, "npy")), item("Field as VTP", () => file({ kind: "vtp", surface: viewer.shape()!, shown: coloured(), field }, "vtp"))]),
      sound && group("Sound", [item("WAV", () => download(new Blob([sound], { type: "audio/wav" }), "wav"))]),
    ];
    menu.replaceChildren(...groups.filter((part): part is HTMLDivElement => Boolean(part)));
  };
  save.addEventListener("toggle", () => save.open && fill());
  closes(save);

  // What lies under the pointer, in the numbering of the mesh that the page draws.
  const readout = h("p", { class: "readout", "aria-hidden": "true", hidden: true });
  viewer.onHover = (hit) => {
    readout.hidden = hit === null;
    const value = look.at(hit?.vertex ?? null);
    if (!hit) return;
    // What repairs renumbered has other numbers in the file.
    readout.textContent = `${renumbered() ? "kept vertex" : "vertex"} ${hit.vertex}${value === null ? "" : ` · ${brief(value)}`}`;
  };
  bar.append(readout);
  app.on("look", () => (up.value = viewer.up));
  app.on("mesh", () => {
    bar.hidden = app.mesh === null;
    up.value = viewer.up;
    edges.setAttribute("aria-pressed", "false");
    slice.reset();
  });
  return bar;
}

/** A menu goes away with a press beside it, and with Escape. */
function closes(details: HTMLDetailsElement) {
  document.addEventListener("pointerdown", (event) => {
    if (details.open && !details.contains(event.target as Node)) details.open = false;
  });
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    details.open = false;
    details.querySelector("summary")!.focus();
  });
}

/** A plane that cuts a part of the surface away, so that one sees inside. */
function slicer(app: App): { element: HTMLElement; reset: () => void } {
  const axis = choice([["none", "nothing"], ["0", "across"], ["1", "by height"], ["2", "by depth"]], "none", () => cut(), "Slice");
  const at = slider("At", { min: 0, max: 1, step: 0.01, value: 0.5 }, () => cut(), (value) => `${Math.round(100 * value)} %`);
  const far = h("input", { type: "checkbox", checked: true, onchange: () => cut() });
  const side = h("label", { class: "row" }, far, "cut the far part away");
  const cut = () => {
    const on = axis.value !== "none";
    at.element.hidden = side.hidden = !on;
    summary.classList.toggle("on", on);
    app.viewer.slice(on ? { axis: Number(axis.value), at: at.control.valueAsNumber, far: far.checked } : null);
  };
  const summary = h("summary", {}, "Slice");
  const element = h("details", { class: "pop slice" }, summary, h("div", { class: "menu" }, field("Slice", axis), at.element, side));
  closes(element);
  at.element.hidden = side.hidden = true;
  return { element, reset: () => {
    axis.value = "none";
    cut();
  } };
}
