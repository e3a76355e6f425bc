// What every part of the page shares: the place, the mesh and the basis that are open, and how errors are told.

import { ApiError, UNREACHABLE, get, hasInside, key, meshContent, post, recent, remove, rename, save, type Basis, type BasisSummary, type Job, type Kind, type Mesh, type Page, type Parameters } from "./api";
import type { Beside } from "./beside";
import { h } from "./dom";
import type { FaceField } from "./files";
import { prepared } from "./geometry";
import { Jobs } from "./jobs";
import { forget, pack, read, same, unpack, write, type Place } from "./place";
import type { Viewer } from "./viewer";

/** One tab. `show` runs whenever it becomes visible and whenever mesh or basis change under it. */
export interface Panel {
  id: string;
  title: string;
  /** What it is for, in a sentence or two. */
  about: string;
  /** The page of the manual on it. */
  guide: string;
  /** The kind of basis it works on, where it needs one. */
  kind?: string;
  /** Whether it can work with this one of them; with all, unless it says so. */
  fits?(basis: BasisSummary): boolean;
  element: HTMLElement;
  show(): void;
  hide(): void;
}

type Happening = "mesh" | "meshes" | "bases" | "basis" | "jobs" | "tab" | "look" | "map";

export class App {
  place: Place = read();
  mesh: Mesh | null = null;
  meshes: Mesh[] = [];
  moreMeshes: string | null = null;
  bases: BasisSummary[] = [];
  basis: Basis | null = null;
  /** A second surface, once one was shown beside the first. */
  beside: Beside | null = null;
  /** What the open tab shows beside the surface that is worth keeping. */
  kept: { lines: number[][][] | null; sound: ArrayBuffer | null; field: FaceField | null } = { lines: null, sound: null, field: null };
  readonly jobs = new Jobs(() => this.emit("jobs"), (job) => this.finished(job), (error) => this.fail(error));
  /** Whether the next mode that is shown begins to swing by itself. */
  swinging = false;
  readonly panels: Panel[] = [];
  private readonly listeners = new Map<Happening, (() => void)[]>();
  private readonly known = new Map<string, Basis>();
  readonly toasts = h("div", { class: "toasts", role: "status", "aria-live": "polite" });
  readonly busy = h("div", { class: "busy", hidden: true }, h("progress", { max: 1 }), h("span", {}));
  readonly title = h("div", { class: "caption" });

  constructor(readonly viewer: Viewer) {
    let pause = 0;
    viewer.onView = () => {
      window.clearTimeout(pause);
      pause = window.setTimeout(() => this.go({ view: viewer.view }), 150);
    };
    window.addEventListener("popstate", () => void this.arrive());
    document.addEventListener("reached", () => {
      for (const toast of [...this.toasts.children]) if (toast.firstElementChild?.textContent === UNREACHABLE) toast.remove();
    });
    // Most of the time this is the second word about a step that was taken already: opening a large mesh twice takes twice as long.
    window.addEventListener("hashchange", () => {
      if (!same(read(), this.place)) void this.arrive();
    });
  }

  on(happening: Happening, listener: () => void) {
    this.listeners.set(happening, [...(this.listeners.get(happening) ?? []), listener]);
  }

  emit(happening: Happening) {
    for (const listener of this.listeners.get(happening) ?? []) listener();
  }

  /** Changes the place, and the address with it. */
  go(change: Partial<Place>, step = false) {
    this.place = { ...this.place, ...change };
    write(this.place, step);
  }

  /** Keeps in the address what was drawn or chosen in the open tab. What is packed has to be plain ASCII. */
  keep(design: unknown) {
    window.clearTimeout(this.keeping);
    const { tab, mesh } = this.place;
    // Browsers refuse an address that changes with every move of a finger.
    this.keeping = window.setTimeout(() => {
      if (this.place.tab === tab && this.place.mesh === mesh) this.go({ design: design === null ? undefined : pack(design) });
    }, 120);
  }

  private keeping = 0;

  private wish: { tab: string; design: string | undefined } | null = null;

  /** What the address one came by holds for a tab. It is given once: from then on the tab itself knows. */
  arrived<T>(tab: string): T | null {
    if (this.wish?.tab !== tab) return null;
    const found = unpack<T>(this.wish.design);
    this.wish = null;
    return found;
  }

  // --- telling ----------------------------------------------------------------------------------------------------------

  /** Shows an error as the server words it. */
  readonly fail = (error: unknown) => {
    if (error instanceof DOMException && error.name === "AbortError") return;
    if (error instanceof ApiError) {
      const { title, detail, type, status } = error.problem;
      this.toast("error", title, detail, type);
      // The basis that is shown was deleted elsewhere: nothing can be had of it any more.
      if (status === 404 && this.basis && detail.includes(this.basis.id)) void this.drop(this.basis.id, this.basis.mesh).catch(this.fail);
      if (status === 401) document.querySelector<HTMLDetailsElement>("details.key")?.setAttribute("open", "");
    } else {
      this.toast("error", "Something went wrong in this page", error instanceof Error ? error.message : String(error));
      console.error(error);
    }
  };

  toast(kind: "error" | "note", title: string, detail: string, type = "") {
    const close = () => toast.remove();
    const toast = h("div", { class: `toast ${kind}`, role: kind === "error" ? "alert" : undefined },
      h("strong", {}, title), h("button", { class: "quiet close", "aria-label": "Close", onclick: close }, "×"),
      h("p", {}, detail),
      type.startsWith("/problems/") && h("a", { href: type, target: "_blank" }, "What this means"));
    // The same error over and over is one error.
    for (const other of this.toasts.children) if (other.textContent === toast.textContent) other.remove();
    this.toasts.append(toast);
    while (this.toasts.children.length > 4) this.toasts.firstElementChild?.remove();
    if (kind === "note") window.setTimeout(close, 6000);
  }

  /** A link to a file of the API. Where a key is needed, which a link cannot carry, the page fetches the file itself. */
  link(text: string, path: string, name: string): HTMLElement {
    return h("a", { href: path, download: name, onclick: (event: Event) => {
      if (!key.get()) return;
      event.preventDefault();
      this.working(`Fetching ${name} …`);
      save(path, name).catch(this.fail).finally(() => this.working(null));
    } }, text);
  }

  working(text: string | null, fraction?: number) {
    this.busy.hidden = text === null;
    this.busy.lastElementChild!.textContent = text ?? "";
    const bar = this.busy.firstElementChild as HTMLProgressElement;
    if (fraction === undefined) bar.removeAttribute("value");
    else bar.value = fraction;
  }

  // --- going places -----------------------------------------------------------------------------------------------------

  /** Opens what the address names. */
  async arrive() {
    const turn = ++this.arriving;
    forget();
    const place = read();
    const moved = place.mesh !== this.mesh?.id;
    if (place.tab !== this.place.tab) this.panel?.hide();
    this.place = place;
    this.wish = { tab: place.tab, design: place.design };
    this.viewer.view = place.view;
    this.viewer.up = place.up ?? this.viewer.guessed;
    this.emit("look");
    try {
      if (!place.mesh) {
        const first = this.meshes[0];
        if (first) await this.open(first.id, false);
        else this.tab(place.tab, false);
      } else if (moved) await this.open(place.mesh, false, true);
      else {
        // A basis that was made elsewhere meanwhile.
        if (place.basis && !this.has(place.basis)) await this.findBases().catch(this.fail);
        if (turn === this.arriving) this.tab(place.tab, false);
      }
      // Another one is shown in its place, and nobody would notice.
      if (turn === this.arriving && place.basis && place.mesh === this.mesh?.id && !this.has(place.basis)) {
        this.toast("note", "That basis is not there", "The address names a basis that this surface does not have: it was deleted, or never was. What is shown is of another one, or of none.");
      }
    } catch (error) {
      this.fail(error);
      // The address says what is shown, and a tab is open whatever it said.
      if (turn !== this.arriving || place.mesh !== this.place.mesh) return;
      this.go({ mesh: this.mesh?.id, basis: this.basis?.id, design: undefined });
      this.tab(place.tab, false);
    }
  }

  private arriving = 0;

  private has(basis: string) {
    return this.bases.some(({ id }) => id === basis);
  }

  /** Only meshes with this in their name are listed. */
  sought = "";

  async list(more = false) {
    const sought = this.sought;
    const page = await get<Page<Mesh>>(`/v1/meshes?limit=50${sought && `&name=${encodeURIComponent(sought)}`}${more && this.moreMeshes ? `&from=${encodeURIComponent(this.moreMeshes)}` : ""}`);
    // Another letter has been typed meanwhile.
    if (sought !== this.sought) return;
    this.meshes = more ? [...this.meshes, ...page.items] : page.items;
    this.moreMeshes = page.next;
    this.emit("meshes");
  }

  private opening = 0;

  /** Opens a mesh. */
  async open(id: string, step = true, keep = false) {
    const turn = ++this.opening;
    this.working("Loading the surface …");
    try {
      // Asked for even if it is listed: its content may come from what the browser has kept, though it was deleted elsewhere.
      const mesh = await get<Mesh>(`/v1/meshes/${id}`);
      if (turn !== this.opening) return;
      const content = await meshContent(mesh.links.content, (fraction) => this.working("Loading the surface …", fraction));
      if (turn !== this.opening) return;
      const surface = await prepared(content);
      if (turn !== this.opening) return;
      this.panel?.hide();
      this.mesh = mesh;
      this.basis = null;
      this.bases = [];
      this.viewer.setMesh(surface, hasInside(mesh));
      this.viewer.onClick = this.viewer.onStroke = null;
      if (!keep) {
        this.viewer.view = undefined;
        this.go({ mesh: id, basis: undefined, mode: 1, view: undefined, up: undefined, design: undefined }, step);
      } else {
        this.go({ mesh: id });
        this.viewer.up = this.place.up ?? this.viewer.guessed;
      }
      this.emit("mesh");
      await this.findBases();
      if (turn === this.opening) this.tab(this.place.tab, false);
    } catch (error) {
      // Somebody else has deleted it: nobody should be sent there again.
      if (error instanceof ApiError && error.problem.status === 404) this.lose(id);
      // What an earlier wish came to is of no interest any more.
      if (turn === this.opening) throw error;
    } finally {
      if (turn === this.opening) this.working(null);
    }
  }

  /** Gives the open mesh another name. */
  async rename(name: string) {
    if (!this.mesh) return;
    const mesh = await rename(this.mesh.id, name);
    this.meshes = this.meshes.map((other) => (other.id === mesh.id ? mesh : other));
    // Another one may have been opened meanwhile.
    const open = this.mesh?.id === mesh.id;
    if (open) this.mesh = mesh;
    this.emit("meshes");
    if (open) this.panel?.show();
  }

  /** Meshes that were deleted here. */
  readonly gone = new Set<string>();

  /** Deletes the open mesh with all that was computed on it. */
  async remove() {
    if (!this.mesh) return;
    const { id, name } = this.mesh;
    try {
      await remove(id);
    } catch (error) {
      // Deleted is what it was to be, whoever did it.
      if (!(error instanceof ApiError) || error.problem.status !== 404) throw error;
    }
    this.lose(id);
    this.toast("note", "Deleted", `${name ?? "The mesh"} and what was computed on it.`);
    if (!this.meshes.length) {
      this.sought = "";
      await this.list();
    }
    // Another one may have been opened meanwhile.
    if (this.mesh?.id !== id) return;
    if (this.meshes[0]) return this.open(this.meshes[0].id);
    this.panel?.hide();
    [this.mesh, this.basis, this.bases] = [null, null, []];
    this.viewer.clear();
    this.go({ mesh: undefined, basis: undefined, view: undefined, up: undefined, design: undefined });
    this.emit("mesh");
    this.tab(this.place.tab, false);
  }

  /** Forgets a mesh that was deleted. */
  private lose(id: string) {
    this.gone.add(id);
    this.meshes = this.meshes.filter((mesh) => mesh.id !== id);
    this.emit("meshes");
    this.jobs.forget(({ mesh }) => mesh === id);
  }

  /** Reads which bases there are on the mesh. */
  async findBases() {
    const mesh = this.mesh?.id;
    if (!mesh) return;
    const page = await get<Page<BasisSummary>>(`/v1/bases?mesh=${mesh}&limit=200`);
    if (mesh !== this.mesh?.id) return;
    this.bases = page.items;
    this.emit("bases");
  }

  get panel(): Panel | undefined {
    return this.panels.find((panel) => panel.id === this.place.tab) ?? this.panels[0];
  }

  /** The bases that the open tab can work on, newest first. */
  basesOf(panel: Panel): BasisSummary[] {
    return this.bases.filter((basis) => basis.kind === panel.kind && (panel.fits?.(basis) ?? true));
  }

  /** Opens a tab. */
  tab(id: string, step = true) {
    for (const panel of this.panels) if (panel !== this.panel) panel.element.hidden = true;
    const before = this.panel;
    if (before && before.id !== id) {
      before.hide();
      before.element.hidden = true;
    }
    // What an earlier tab has asked for is not put into this one.
    this.using += 1;
    this.viewer.cursor.leave();
    this.kept = { lines: null, sound: null, field: null };
    recent.shown = null;
    this.viewer.onClick = this.viewer.onStroke = null;
    this.viewer.onStrokeEnd = () => {};
    this.go({ tab: id, ...(before?.id === id ? {} : { design: undefined }) }, step && before?.id !== id);
    const panel = this.panel;
    if (!panel) return;
    panel.element.hidden = false;
    this.emit("tab");
    const candidates = this.basesOf(panel);
    const wanted = candidates.find((basis) => basis.id === this.place.basis) ?? candidates.find((basis) => basis.id === this.basis?.id) ?? candidates[0];
    if (panel.kind && wanted && wanted.id !== this.basis?.id) void this.use(wanted.id).catch(this.fail);
    else {
      if (panel.kind && !wanted) this.basis = null;
      this.emit("basis");
      panel.show();
    }
  }

  private using = 0;

  /** Works with a basis from now on. */
  async use(id: string, step = false) {
    const turn = ++this.using;
    const basis = this.known.get(id) ?? (await get<Basis>(`/v1/bases/${id}`));
    this.known.set(id, basis);
    // Another one was chosen meanwhile.
    if (turn !== this.using || basis.mesh !== this.mesh?.id) return;
    this.panel?.hide();
    this.basis = basis;
    this.go({ basis: id }, step);
    this.emit("basis");
    this.panel?.show();
  }

  // --- jobs -------------------------------------------------------------------------------------------------------------

  /** Submits a job, on the open mesh unless another is named, and follows it. */
  async submit<K extends Kind>(kind: K, parameters: Parameters<K>, mesh = this.mesh?.id) {
    if (!mesh) return;
    try {
      const job = await post<Job>("/v1/jobs", { kind, mesh, parameters });
      if (job.status === "succeeded" && job.basis) {
        this.toast("note", "Known already", "Equal work is done once: this is the stored result.");
        this.jobs.put(job);
        await this.finished(job);
      } else this.jobs.follow(job);
    } catch (error) {
      this.fail(error);
    }
  }

  /** Deletes a job that has ended with the basis that it made, which nothing here goes on using. */
  async removeJob(job: Job) {
    try {
      await this.jobs.remove(job);
      if (job.basis) await this.drop(job.basis, job.mesh);
    } catch (error) {
      this.fail(error);
    }
  }

  /** Goes on without a basis that was deleted. */
  private async drop(basis: string, mesh: string | null) {
    this.known.delete(basis);
    if (mesh !== this.mesh?.id) return;
    await this.findBases();
    if (this.basis?.id !== basis || this.has(basis)) return;
    this.panel?.hide();
    this.basis = null;
    this.tab(this.place.tab, false);
  }

  /** Shows what a job made, where it is of the open mesh. */
  readonly finished = async (job: Job) => {
    if (job.status !== "succeeded" || job.mesh !== this.mesh?.id) return;
    await this.findBases();
    const panel = this.panel;
    if (job.basis && panel && this.basesOf(panel).some((basis) => basis.id === job.basis)) await this.use(job.basis, true);
  };
}
