// The left column: files come in, meshes are listed, jobs report.

import { ApiError, ENDINGS, stem, upload, type Mesh } from "./api";
import type { App } from "./app";
import { brief, choice, grouped, h, plural, words } from "./dom";
import { jobCard, renew } from "./queue";
import { fieldName } from "./panels/basis";
import { samples } from "./welcome";

/** Jobs that are shown beside the surfaces; the list of jobs has all of them. */
const MOST_JOBS = 4;

export function library(app: App): HTMLElement {
  const input = h("input", { type: "file", multiple: true, class: "visually-hidden", id: "file", accept: [...ENDINGS, "gz", "zst"].map((ending) => `.${ending}`).join(",") });
  const drop = h("label", { class: "drop", for: "file" }, h("strong", {}, "Drop a mesh here"), h("span", {}, "or choose one: OBJ, PLY, OFF, STL, MEDIT, VTK, Gmsh, FreeSurfer, glTF, GIFTI; also gzipped"), input);
  const uploads = h("div", { class: "uploads" });
  const jobs = h("div", { class: "jobs", role: "group", "aria-label": "Jobs" });
  const meshes = h("ul", { class: "meshes", "aria-label": "Meshes" });
  const nothing = h("p", { class: "dim", hidden: true }, "No surface has this in its name.");
  const search = h("input", { type: "search", placeholder: "Search by name", "aria-label": "Search by name" });
  let pause = 0;
  search.addEventListener("input", () => {
    window.clearTimeout(pause);
    pause = window.setTimeout(() => {
      app.sought = search.value.trim();
      app.list().catch(app.fail);
    }, 200);
  });
  let order = "newest";
  const sort = choice([["newest", "newest first"], ["name", "by name"], ["size", "largest first"]], order, (value) => {
    order = value;
    showMeshes();
  }, "Order of the surfaces");
  const tools = h("div", { class: "seek", hidden: true }, search, sort);
  const more = h("button", { class: "quiet", hidden: true, onclick: () => app.list(true).catch(app.fail) }, "Older ones");

  const take = async (list: Iterable<File>) => {
    const files = [...list];
    for (const file of files) {
      const bar = h("progress", { max: 1, value: 0 });
      const row = h("div", { class: "card" }, h("strong", {}, file.name), bar, h("small", {}, "uploading …"));
      uploads.append(row);
      try {
        const mesh = await upload(file, (fraction) => {
          bar.value = fraction;
          if (fraction === 1) row.lastElementChild!.textContent = "being read and checked …";
        });
        // What came is seen, whatever was searched for.
        app.sought = search.value = "";
        await app.list();
        if (mesh.name && mesh.name !== stem(file.name)) app.toast("note", "Known already", `What is in ${file.name} is stored as ${mesh.name}.`);
        await app.open(mesh.id);
      } catch (error) {
        // Of several files it is told which one.
        app.fail(files.length > 1 && error instanceof ApiError ? new ApiError({ ...error.problem, detail: `${file.name}: ${error.problem.detail}` }) : error);
      }
      row.remove();
    }
    input.value = "";
  };
  input.addEventListener("change", () => void take([...(input.files ?? [])]));
  let inside = 0;
  const over = (event: DragEvent, change: number) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    inside += change;
    document.body.classList.toggle("dropping", inside > 0);
  };
  window.addEventListener("dragenter", (event) => over(event, 1));
  window.addEventListener("dragleave", (event) => over(event, -1));
  window.addEventListener("dragover", (event) => over(event, 0));
  window.addEventListener("drop", (event) => {
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    inside = 0;
    document.body.classList.remove("dropping");
    void take([...event.dataTransfer.files]);
  });

  const showMeshes = () => {
    // Whoever types a name goes on typing it.
    if (meshes.contains(document.activeElement) && document.activeElement instanceof HTMLInputElement) return;
    const inside = meshes.contains(document.activeElement);
    if (!app.sought && document.activeElement !== search) search.value = "";
    const sorted = app.meshes.slice();
    if (order === "name") sorted.sort((a, b) => title(a).localeCompare(title(b), undefined, { numeric: true }));
    if (order === "size") sorted.sort((a, b) => b.vertices - a.vertices);
    // An address or a job may have opened one that is older than those that are listed; only here it can be renamed and deleted.
    const { mesh } = app;
    if (mesh && !app.sought && !app.gone.has(mesh.id) && !sorted.some(({ id }) => id === mesh.id)) sorted.unshift(mesh);
    meshes.replaceChildren(...sorted.map((mesh) => meshItem(app, mesh)));
    if (inside) meshes.querySelector<HTMLElement>("button[aria-current]")?.focus();
    tools.hidden = app.meshes.length < 4 && !app.sought;
    nothing.hidden = app.meshes.length > 0 || !app.sought;
    more.hidden = !app.moreMeshes;
  };
  const showJobs = () => {
    const listed = app.jobs.list.filter((job) => job.status !== "succeeded").slice(0, MOST_JOBS);
    renew(jobs, listed.map((job) => jobCard(app, job, { dismiss: true })));
  };
  for (const happening of ["meshes", "mesh", "bases", "basis"] as const) app.on(happening, showMeshes);
  app.on("jobs", showJobs);
  return h("aside", { class: "library", "aria-label": "Library" }, drop, uploads, jobs, h("h2", {}, "Surfaces"), tools, meshes, nothing, more,
    h("details", { class: "examples" }, h("summary", {}, "Examples"), samples(app)));
}

/** What a mesh is called. */
const title = ({ id, name }: Pick<Mesh, "id" | "name">) => name ?? `mesh ${id.slice(0, 8)}`;

function meshItem(app: App, mesh: Mesh): HTMLElement {
  const open = mesh.id === app.mesh?.id;
  const button = h("button", { class: "mesh", title: title(mesh), "aria-current": open ? "true" : undefined, onclick: () => app.open(mesh.id).catch(app.fail) },
    h("strong", {}, title(mesh)), h("small", {}, `${grouped(mesh.vertices)} vertices`));
  if (!open) return h("li", {}, button);
  const bases = app.bases.map((basis) => {
    const method = basis.kind === "field_basis" ? fieldName(basis.parameters) : "operator" in basis.parameters && basis.parameters.operator === "hodge" ? "fields" : "method" in basis.parameters ? basis.parameters.method : "";
    const text = `${words(basis.kind)} · ${grouped(basis.count)}${method ? ` · ${method}` : ""}`;
    const suited = app.panels.filter((panel) => panel.kind === basis.kind && (panel.fits?.(basis) ?? true));
    const tab = suited.find((panel) => panel.id === app.place.tab) ?? suited[0];
    return h("li", {}, h("button", {
      class: "basis", "aria-current": basis.id === app.basis?.id ? "true" : undefined, disabled: !tab,
      onclick: () => {
        app.go({ basis: basis.id }, true);
        if (tab) app.tab(tab.id, false);
      },
    }, text));
  });
  return h("li", { class: "open" }, button, report(mesh), handles(app, mesh), h("ul", { class: "bases", "aria-label": "Bases" }, ...bases));
}

/** Renaming and deleting; deleting asks once more. */
function handles(app: App, mesh: Mesh): HTMLElement {
  const row = h("div", { class: "row handles" });
  const usual = () => row.replaceChildren(
    h("button", { class: "quiet", onclick: () => {
      const name = h("input", { type: "text", maxLength: 200, "aria-label": "New name" });
      name.value = title(mesh);
      const form = h("form", { class: "row", onsubmit: (event: Event) => {
        event.preventDefault();
        const wanted = name.value.trim();
        if (!wanted || wanted === mesh.name) return usual();
        name.blur();
        app.rename(wanted).catch(app.fail);
      } }, name, h("button", {}, "Rename"));
      form.addEventListener("keydown", (event) => event.key === "Escape" && usual());
      row.replaceChildren(form);
      name.select();
    } }, "Rename"),
    h("button", { class: "quiet", onclick: () => {
      const sure = h("button", { class: "danger", onclick: () => app.remove().catch(app.fail) }, app.bases.length ? `Delete with ${plural(app.bases.length, "basis", "bases")}` : "Delete for good");
      row.replaceChildren(sure, h("button", { class: "quiet", onclick: usual }, "Keep"));
      sure.focus();
    } }, "Delete"));
  usual();
  return row;
}

/** A surface is seen to be coarse where single precision has fewer steps than this along its longest side. */
const STEPS = 1000;

/** The step between neighbouring numbers of single precision where a mesh lies; 0 where it is too fine to be seen. */
function coarse({ report: { bounding_box } }: Mesh): number {
  const [low, high] = bounding_box ?? [[], []];
  const far = Math.max(...low.map(Math.abs), ...high.map(Math.abs));
  const step = 2 ** (Math.floor(Math.log2(far)) - 23);
  return STEPS * step > Math.max(...high.map((value, k) => value - low[k])) ? step : 0;
}

/** What was found in a mesh, in words. */
function report(mesh: Mesh): HTMLElement {
  const { genus, components, boundary_loops: loops, closed, points, area, defects, repairs } = mesh.report;
  const rim = loops ? plural(loops, "boundary loop") : closed ? "closed" : null;
  const shape = [points ? "points without faces" : plural(mesh.faces, "face"), plural(components, "component"), genus === null ? null : `genus ${genus}`, rim, `area ${brief(area)}`];
  const grain = coarse(mesh);
  const line = (defect: (typeof defects)[number] | (typeof repairs)[number]) => {
    const where = "examples" in defect && defect.examples.length ? ` (${defect.element} ${defect.examples.slice(0, 3).map(grouped).join(", ")}${defect.count > 3 ? " …" : ""})` : "";
    return h("li", {}, `${grouped(defect.count)} × ${words(defect.kind)}${where}`);
  };
  return h("div", { class: "report" },
    h("p", {}, shape.filter(Boolean).join(" · ")),
    grain > 0 && h("p", { class: "unproven" }, `Far from the origin for its size: what is drawn here, and taken away from here, is in steps of ${brief(grain)}. What the server computes is not.`),
    defects.length > 0 && h("details", { class: "defects" }, h("summary", {}, `${plural(defects.length, "kind")} of defect found`), h("ul", {}, ...defects.map(line))),
    repairs.length > 0 && h("details", { class: "defects" }, h("summary", {}, `${plural(repairs.length, "repair")} done`), h("ul", {}, ...repairs.map(line))));
}
