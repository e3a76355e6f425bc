// What stands over the surface: which way is up, its edges, and everything on the screen as a file or as a request.

import { kept, recent } from "./api";
import type { App } from "./app";
import { curl, python, type Request } from "./code";
import { brief, choice, h } from "./dom";
import type { Coloured } from "./files";
import { records } from "./film";
import type { Look } from "./panels/basis";
import type { Up } from "./upright";

/** Fetched where a file is asked for: the page is there sooner without them. */
const files = () => import("./files");

/** Seconds of a film: one turn of the surface. */
const FILM = 6;

/** Whether these parameters are all there: of long lists the server keeps only a hash beside a basis. */
const whole = (value: unknown): boolean =>
  !value || typeof value !== "object" || ((Array.isArray(value) || !("blake3" in value)) && Object.values(value).every(whole));

export function toolbar(app: App, look: Look): HTMLElement {
  const { viewer } = app;
  const up = choice([["y", "y is up"], ["z", "z is up"], ["x", "x is up"], ["-y", "−y is up"], ["-z", "−z is up"], ["-x", "−x is up"]], "y", (value) => {
    viewer.up = value as Up;
    app.go({ up: value === viewer.guessed ? undefined : (value as Up) });
    app.emit("look");
  }, "Up axis");
  const edges = h("button", { "aria-pressed": "false", title: "Show the edges of the mesh", onclick: () => {
    const on = edges.getAttribute("aria-pressed") !== "true";
    edges.setAttribute("aria-pressed", String(on));
    viewer.edges(on);
  } }, "Edges");
  const menu = h("div", { class: "menu" });
  const save = h("details", { class: "save" }, h("summary", {}, "Save"), menu);
  const bar = h("div", { class: "stagebar", role: "group", "aria-label": "View", hidden: true }, up, edges, save);

  const renumbered = () => app.mesh?.report.file !== undefined && app.mesh.report.file !== null;
  const name = () => [app.mesh?.name ?? "mesh", app.title.textContent !== app.mesh?.name ? app.title.textContent : ""].filter(Boolean).join("-").toLowerCase().replace(/[^a-z0-9]+/g, "-");
  const download = (blob: Blob, ending: string) => {
    const link = h("a", { href: URL.createObjectURL(blob), download: `${name()}.${ending}` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  };
  const coloured = (): Coloured | null => look.coloured();
  const copy = async (text: string, what: string) => {
    try {
      await navigator.clipboard.writeText(text);
      app.toast("note", "Copied", `${what} is on the clipboard.`);
    } catch {
      // Without the right to the clipboard, the text can still be taken by hand.
      const box = h("textarea", { readOnly: true, rows: 8, "aria-label": `${what}: copy it from here` });
      box.value = text;
      box.addEventListener("blur", () => box.remove());
      bar.append(box);
      box.focus();
      box.select();
    }
  };
  const item = (text: string, act: () => unknown) =>
    h("button", { class: "quiet", onclick: () => {
      save.open = false;
      Promise.resolve().then(act).catch(app.fail);
    } }, text);
  const group = (title: string, items: (HTMLElement | false)[]) => items.some(Boolean) && h("div", {}, h("h3", {}, title), ...items);
  const fill = () => {
    const shown = coloured();
    const { lines, sound } = app.kept;
    const request = recent.shown;
    const basis = app.basis;
    const job: Request | null = basis && whole(basis.parameters) ? { method: "POST", path: kept("/v1/jobs", "POST"), body: { kind: basis.kind, mesh: basis.mesh, parameters: basis.parameters } } : null;
    const groups = [
      group("Picture", [item("PNG", async () => download(await viewer.snapshot(), "png")), records() && item(`Film of a turn, ${FILM} s`, async () => {
        app.toast("note", "Recording", `The surface turns once, for ${FILM} seconds.`);
        download(await viewer.film(FILM), "webm");
      }), lines !== null && item("Lines as SVG", async () => {
        const { svg } = await files();
        const { width, height, runs } = viewer.drawn(lines);
        download(svg(runs, width, height, Math.max(0.6, width / 1200)), "svg");
      })]),
      group("Surface as shown", [item("OBJ", async () => download((await files()).obj(viewer.shape()!), "obj")), item(shown ? "PLY with colours" : "PLY", async () => download((await files()).ply(viewer.shape()!, coloured()), "ply")),
        item("GLB", async () => {
          const { surface, normals } = viewer.turned()!;
          download(await (await files()).glb(surface, normals, coloured()), "glb");
        }), item("VTP (ParaView)", async () => download((await files()).vtp(viewer.shape()!, coloured()), "vtp"))]),
      shown && group("Values at the vertices", [item("CSV", async () => download((await files()).csv(viewer.shape()!, coloured()!, renumbered() ? "kept_vertex" : "vertex"), "csv")), item("NPY (NumPy)", async () => download((await files()).npy(coloured()!.values), "npy"))]),
      sound && group("Sound", [item("WAV", () => download(new Blob([sound], { type: "audio/wav" }), "wav"))]),
      request && group("Copy the request", [item("as curl", () => copy(curl(request), "The request for curl")), item("as Python", () => copy(python(request), "The request in Python"))]),
      job && group("Copy the job", [item("as curl", () => copy(curl(job), "The job for curl")), item("as Python", () => copy(python(job), "The job in Python"))]),
    ];
    menu.replaceChildren(...groups.filter((part): part is HTMLDivElement => Boolean(part)));
  };
  save.addEventListener("toggle", () => save.open && fill());
  document.addEventListener("pointerdown", (event) => {
    if (save.open && !save.contains(event.target as Node)) save.open = false;
  });
  save.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    save.open = false;
    save.querySelector("summary")!.focus();
  });

  // What lies under the pointer, in the numbering of the mesh that the page draws.
  const readout = h("p", { class: "readout", "aria-hidden": "true", hidden: true });
  viewer.onHover = (hit) => {
    readout.hidden = hit === null;
    if (!hit) return;
    const value = look.at(hit.vertex);
    // What repairs renumbered has other numbers in the file.
    readout.textContent = `${renumbered() ? "kept vertex" : "vertex"} ${hit.vertex}${value === null ? "" : ` · ${brief(value)}`}`;
  };
  bar.append(readout);
  app.on("look", () => (up.value = viewer.up));
  app.on("mesh", () => {
    bar.hidden = app.mesh === null;
    up.value = viewer.up;
    edges.setAttribute("aria-pressed", "false");
  });
  return bar;
}
