// What pointer and keys do on a surface.

import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Hit } from "./surface";
import type { Viewer } from "./viewer";

/** Corners of a mesh under which a moving pointer may ask what is there. */
const HOVERED = 300_000;

/** Hears the pointer and the keys for a viewer. */
export function listen(viewer: Viewer, controls: OrbitControls) {
  const { canvas } = viewer;
  let stroke = false;
  let down: { x: number; y: number; hit: Hit | null } | null = null;
  // Before the controls see it: a stroke keeps the camera still.
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !event.isPrimary) return;
    const hit = viewer.onStroke || viewer.onClick ? viewer.pick(event.clientX, event.clientY) : null;
    down = { x: event.clientX, y: event.clientY, hit };
    if (hit && viewer.onStroke?.(hit, "begin")) {
      stroke = true;
      controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
    }
  }, { capture: true });
  canvas.addEventListener("pointermove", (event) => {
    if (!stroke) return;
    const hit = viewer.pick(event.clientX, event.clientY);
    if (hit) viewer.onStroke?.(hit, "move");
  });
  // A ray meets every triangle: on a large mesh only a pointer that rests asks.
  let rest = 0;
  canvas.addEventListener("pointermove", (event) => {
    window.clearTimeout(rest);
    if (event.buttons || event.pointerType === "touch") return;
    const ask = () => viewer.onHover(viewer.pick(event.clientX, event.clientY));
    rest = window.setTimeout(ask, (viewer.surface?.triangles.length ?? 0) > HOVERED ? 250 : 30);
  });
  canvas.addEventListener("pointerleave", () => {
    window.clearTimeout(rest);
    viewer.onHover(null);
  });
  const end = (event: PointerEvent) => {
    const moved = down ? Math.hypot(event.clientX - down.x, event.clientY - down.y) : 0;
    if (stroke) {
      stroke = false;
      controls.enabled = true;
      viewer.onStrokeEnd();
    } else if (down?.hit && moved < 5 && event.type === "pointerup") viewer.onClick?.(down.hit);
    down = null;
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("focus", () => viewer.onKeys(viewer.cursor.hint));
  canvas.addEventListener("keydown", (event) => {
    if (viewer.cursor.key(event)) return event.preventDefault();
    const step = event.shiftKey ? 0.4 : 0.1;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => viewer.turn(step, 0), ArrowRight: () => viewer.turn(-step, 0),
      ArrowUp: () => viewer.turn(0, -step), ArrowDown: () => viewer.turn(0, step),
      "+": () => viewer.turn(0, 0, 1.15), "=": () => viewer.turn(0, 0, 1.15), "-": () => viewer.turn(0, 0, 1 / 1.15),
      Home: () => { viewer.view = undefined; viewer.onView(); },
    };
    const move = event.ctrlKey || event.metaKey || event.altKey ? undefined : moves[event.key];
    if (!move) return;
    event.preventDefault();
    move();
  });
}
