// A cursor on the surface for the keyboard: everything that a pointer does there can be done with it.

import { BackSide, Group, Mesh, MeshBasicMaterial, SphereGeometry } from "three";
import type { Hit } from "./surface";
import type { Viewer } from "./viewer";

/** Pixels that an arrow key moves the cursor, and with Alt. */
const STEP = 14;
const FINE = 4;
/** A step longer than this part of the radius leads over an edge to something behind it. */
const JUMP = 0.3;

const WAYS: Record<string, [x: number, y: number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Cursor {
  hit: Hit | null = null;
  /** Whether a stroke is being drawn. */
  pressed = false;
  /** Hears what a screen reader should say. */
  tell: (text: string) => void = () => {};

  constructor(private readonly viewer: Viewer) {}

  /** What the keys do now, in one line. */
  get hint(): string {
    if (!this.hit) return `Arrows turn · + and − zoom · Home goes back${this.useful ? " · Enter puts a cursor on the surface" : ""}`;
    const act = this.pressed ? "Enter ends the stroke" : this.viewer.onClick ? "Enter chooses this point" : "Enter begins";
    return `Arrows move the cursor, with Alt finely · ${act} · Shift and arrows turn · Esc leaves`;
  }

  private get useful(): boolean {
    return this.viewer.onClick !== null || this.viewer.onStroke !== null;
  }

  /** Takes the cursor away. */
  leave() {
    if (this.pressed) this.release();
    this.hit = null;
    this.show();
  }

  /** Does what a key says; true if it says something. */
  key(event: KeyboardEvent): boolean {
    if (!this.useful || event.ctrlKey || event.metaKey) return false;
    if (event.key === "Escape" && this.hit) this.leave();
    else if (event.key === "Enter" || event.key === " ") this.enter();
    else if (this.hit && !event.shiftKey && WAYS[event.key]) this.move(WAYS[event.key], event.altKey ? FINE : STEP);
    else return false;
    return true;
  }

  private enter() {
    const { viewer } = this;
    if (!this.hit) {
      this.hit = viewer.middle();
      this.tell(this.hit ? `Cursor at vertex ${this.hit.vertex}. ${this.hint}` : "No surface in sight");
    } else if (this.pressed) {
      this.release();
      this.tell("The stroke has ended");
    } else if (viewer.onClick) {
      viewer.onClick(this.hit);
      this.tell(`Vertex ${this.hit.vertex} chosen`);
    } else {
      const taken = viewer.onStroke?.(this.hit, "begin");
      if (taken === "point") viewer.onStrokeEnd();
      else if (taken) this.pressed = true;
      this.tell(this.pressed ? "A stroke begins" : `Set at vertex ${this.hit.vertex}`);
    }
    this.show();
  }

  private release() {
    this.pressed = false;
    this.viewer.onStrokeEnd();
  }

  private move([dx, dy]: [number, number], step: number) {
    const { viewer } = this;
    const from = this.hit!.point;
    let found: Hit | null = null;
    // Where the surface turns away, the view goes around with the cursor.
    for (let turn = 0; turn < 6 && !found; turn++) {
      const [x, y] = viewer.window(from);
      const hit = viewer.inside(x, y, 0.04) ? viewer.pick(x + step * dx, y + step * dy) : null;
      const far = hit ? Math.hypot(hit.point[0] - from[0], hit.point[1] - from[1], hit.point[2] - from[2]) : Infinity;
      if (far < JUMP * viewer.radius) found = hit;
      else viewer.turn(-0.2 * dx, -0.2 * dy);
    }
    if (!found) return;
    this.hit = found;
    if (this.pressed) viewer.onStroke?.(found, "move");
    this.tell(`Vertex ${found.vertex}`);
    this.show();
  }

  private show() {
    const { viewer, hit } = this;
    let dot: Group | null = null;
    if (hit) {
      const ball = (radius: number, color: number, side?: typeof BackSide) => new Mesh(new SphereGeometry(radius * viewer.radius, 16, 12), new MeshBasicMaterial({ color, ...(side ? { side } : {}) }));
      dot = new Group();
      for (const part of [ball(0.02, this.pressed ? 0xc2185b : 0xffd23f), ball(0.026, 0x10141a, BackSide)]) {
        part.position.set(...hit.point);
        dot.add(part);
      }
    }
    viewer.overlay("cursor", dot);
    viewer.onKeys(this.hint);
  }
}
