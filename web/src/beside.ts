// A second surface beside the first, with a viewer of its own.

import { hasInside, meshContent, type Mesh } from "./api";
import type { App } from "./app";
import { h } from "./dom";
import { prepared } from "./geometry";
import { Viewer } from "./viewer";

export class Beside {
  readonly viewer: Viewer;
  /** The mesh that is shown. */
  mesh: Mesh | null = null;
  /** Whether both cameras move as one. */
  linked = true;
  private readonly pane: HTMLElement;
  private readonly caption = h("div", { class: "caption" });
  private turn = 0;

  constructor(private readonly app: App, stage: HTMLElement) {
    const hints = h("p", { class: "keys", id: "keys-beside", "aria-hidden": "true" });
    const spoken = h("p", { class: "visually-hidden", "aria-live": "polite" });
    const canvas = h("canvas", { class: "surface", tabIndex: 0, role: "application", "aria-label": "The other surface", "aria-describedby": "keys-beside" });
    this.pane = h("div", { class: "pane beside", hidden: true }, canvas, hints, spoken, this.caption);
    stage.querySelector(".pane")!.after(this.pane);
    this.viewer = new Viewer(canvas);
    this.viewer.onKeys = (hint) => (hints.textContent = hint);
    this.viewer.cursor.tell = (text) => (spoken.textContent = text);
    let passing = false;
    const pass = (from: Viewer, to: Viewer) => {
      if (passing || !this.linked || this.pane.hidden) return;
      passing = true;
      to.follow(from);
      passing = false;
    };
    const own = app.viewer.onView;
    app.viewer.onView = () => {
      own();
      pass(app.viewer, this.viewer);
    };
    this.viewer.onView = () => pass(this.viewer, app.viewer);
  }

  /** Shows the pane, or takes it away. */
  show(on: boolean) {
    this.pane.hidden = !on;
    this.pane.parentElement!.classList.toggle("two", on);
    if (on && this.linked) this.viewer.follow(this.app.viewer);
  }

  /** Shows nothing any more. */
  drop() {
    this.turn += 1;
    this.mesh = null;
    this.show(false);
    this.viewer.clear();
  }

  /** Loads a mesh; false where another was wanted meanwhile. */
  async load(mesh: Mesh): Promise<boolean> {
    const turn = ++this.turn;
    if (this.mesh?.id !== mesh.id) {
      const surface = await prepared(await meshContent(mesh.links.content, () => {}));
      if (turn !== this.turn) return false;
      this.mesh = mesh;
      this.viewer.setMesh(surface, hasInside(mesh));
    }
    this.caption.textContent = mesh.name ?? "";
    return true;
  }
}
