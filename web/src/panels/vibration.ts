// Vibration: tap the surface, watch it ring slowly, and hear it as it would sound.

import { postNumbers, send, type Basis, type Parameters } from "../api";
import type { App, Panel } from "../app";
import { brief, choice, field, grouped, h, plural, slider } from "../dom";
import { latest } from "../latest";
import { Plot, type Frame } from "../plot";
import type { Hit } from "../surface";
import { basisHead } from "./basis";
import { expected } from "./expected";
import type { Look } from "./look";
import { Clamp, showHeld } from "./clamp";

/** Young's modulus in pascal, Poisson's ratio, density in kg/m³. */
const MATERIALS: Record<string, { name: string; young: number; poisson: number; density: number }> = {
  bronze: { name: "bronze", young: 1.1e11, poisson: 0.34, density: 8800 },
  steel: { name: "steel", young: 2.0e11, poisson: 0.3, density: 7800 },
  glass: { name: "glass", young: 7.0e10, poisson: 0.24, density: 2500 },
  wood: { name: "wood", young: 1.1e10, poisson: 0.3, density: 600 },
};
/** Damping: of all modes alike in 1/s, and more of higher ones in s. */
const DAMPING = { alpha: 3, beta: 4e-7 };
/** Seconds on the screen for one swing of the lowest mode. */
const SWING = 0.9;
/** How far the surface is moved on the screen at most, in its radius. */
const SHOWN = 0.09;

interface Tap {
  basis: Basis;
  vertex: number;
  momentum: number[];
}

export function vibrationPanel(app: App, look: Look): Panel {
  const clamp = new Clamp(app, () => app.panel?.id === "vibration" && prepare());
  const head = basisHead(app, () => panel, "vibration", form(app, clamp));
  const body = h("div", { hidden: true });
  const facts = h("p", {});
  const timing = h("p", { class: "dim" });
  let tap: Tap | null = null;
  /** The tap that is to be heard, also when it has faded from sight. */
  let last: Tap | null = null;
  let began = 0;
  let scale = 0;
  let audio: AudioContext | null = null;
  let playing: AudioBufferSourceNode | null = null;

  const frequencies = (basis: Basis) => basis.eigenvalues.map((value) => Math.sqrt(Math.max(value, 0)) / (2 * Math.PI));
  /** Rigid motions come first, and their eigenvalues are zero. */
  const rigid = (basis: Basis) => basis.eigenvalues.filter((value) => value <= 0).length;
  /** The lowest frequency that is no rigid motion. */
  const lowest = (basis: Basis) => frequencies(basis)[rigid(basis)] ?? 1;
  /** How many vertices are held; of a long list the server tells only that. */
  const held = (basis: Basis) => {
    const list = basis.kind === "vibration_basis" ? basis.parameters.clamped : undefined;
    return Array.isArray(list) ? list.length : (list?.numbers ?? 0);
  };
  const load = ({ vertex, momentum }: Tap) => [{ impulse: { vertex, time: 0, momentum } }];
  const slow = slider("Slow motion", { min: 0.25, max: 4, step: 0.05, value: 1 }, () => {}, (value) => `${brief(value)} ×`);
  const mute = h("input", { type: "checkbox", checked: true });

  // --- watching ------------------------------------------------------------------------------------------------------------

  let frames = 0;
  let shown = 0;
  let told = 0;
  let sizes = new Float32Array(0);
  const show = latest<{ tap: Tap; time: number }>(async ({ tap: now, time }) => {
    const moved = await postNumbers(`${now.basis.links.self}/simulate`, { damping: DAMPING, loads: load(now), times: [time] });
    const surface = app.viewer.surface;
    // Two are under way at once, so that the server computes while the page draws; one that was overtaken is of no use.
    if (tap !== now || app.panel !== panel || !surface || time < shown) return;
    shown = time;
    const rest = app.viewer.resting!;
    if (held(now.basis) === 0) withoutRigid(rest, moved);
    const largest = SHOWN * app.viewer.radius;
    sizes = sizes.length === moved.length / 3 ? sizes : new Float32Array(moved.length / 3);
    let most = 0;
    for (let v = 0; v < sizes.length; v++) {
      const x = moved[3 * v], y = moved[3 * v + 1], z = moved[3 * v + 2];
      sizes[v] = Math.sqrt(x * x + y * y + z * z);
      most = Math.max(most, sizes[v]);
    }
    // The largest displacement so far fills what is shown: only the first moments change the scale.
    if (most > 0) scale = Math.min(scale || Infinity, largest / most);
    for (let i = 0; i < moved.length; i++) moved[i] = rest[i] + scale * moved[i];
    for (let v = 0; v < sizes.length; v++) sizes[v] *= scale;
    app.viewer.setPositions(moved);
    if (frames === 0) look.show({ values: sizes, range: [0, largest], diverging: false }, ["still", "moves most"]);
    else app.viewer.setValues(sizes);
    frames += 1;
    // Words are laid out at a great price, and nobody reads them sixty times a second.
    if (performance.now() - told < 250) return;
    told = performance.now();
    timing.textContent = `${brief(time * 1000)} ms after the tap, ${brief(SWING * lowest(now.basis) * slow.control.valueAsNumber)} times slower`;
    document.body.dataset.vibrating = String(frames);
  }, app.fail, 2);
  const run = () => {
    app.viewer.animate((now) => {
      if (!tap || app.panel !== panel) return false;
      began ||= now;
      const time = (now - began) / (SWING * lowest(tap.basis) * slow.control.valueAsNumber);
      // Once it has faded, it is still.
      if (time * (DAMPING.alpha + DAMPING.beta * (2 * Math.PI * lowest(tap.basis)) ** 2) > 12) {
        rest();
        return false;
      }
      show({ tap, time });
      return true;
    });
  };
  const rest = () => {
    tap = null;
    app.viewer.animate(null);
    app.viewer.setPositions(null);
    look.show(null);
  };

  // --- hearing -------------------------------------------------------------------------------------------------------------

  const hear = async (now: Tap) => {
    const listener = app.viewer.fromScene([0, 0.5, 3]);
    const response = await send(`${now.basis.links.self}/simulate`, {
      method: "POST",
      headers: { "Content-Type": "application/json", Accept: "audio/wav" },
      body: JSON.stringify({ damping: DAMPING, loads: load(now), sound: { listener, sample_rate: 44100, seconds: 2 } }),
    });
    const wave = await response.arrayBuffer();
    // Another tap has been made meanwhile, or the tab was left.
    if (now !== last) return;
    app.kept.sound = wave.slice(0);
    document.body.dataset.heard = String(wave.byteLength);
    audio ??= new AudioContext();
    await audio.resume();
    const sound = await audio.decodeAudioData(wave);
    if (now !== last) return;
    playing?.stop();
    playing = audio.createBufferSource();
    playing.buffer = sound;
    playing.connect(audio.destination);
    playing.start();
  };
  const strike = (hit: Hit) => {
    const basis = app.basis;
    const normal = app.viewer.normalAt(hit.vertex);
    if (!basis || !normal) return;
    app.viewer.setPositions(null);
    tap = { basis, vertex: hit.vertex, momentum: normal.map((x) => -0.01 * x) };
    began = 0;
    scale = 0;
    frames = 0;
    shown = 0;
    last = tap;
    if (mute.checked) hear(tap).catch(app.fail);
    run();
  };

  const plot = new Plot(110, "The frequencies of the modes", (frame) => app.basis && paint(frame, frequencies(app.basis)));
  body.append(h("p", {}, "Tap the surface: click it, or move the cursor there with the keyboard."), facts, plot.canvas, slow.element,
    h("label", { class: "row" }, mute, "with sound"), h("div", { class: "row" }, h("button", { onclick: () => middle() }, "Tap"), h("button", { onclick: rest }, "Stop")), timing);
  /** Taps where the cursor is, or in the middle of what is seen. */
  const middle = () => {
    const hit = app.viewer.cursor.hit ?? app.viewer.middle();
    if (hit) strike(hit);
  };
  const making = head.element.querySelector("details")!;
  /** Whether the pointer paints what a new vibration holds, or taps the one that is there. */
  const prepare = () => {
    const basis = app.basis;
    const painting = making.open && clamp.painting;
    if (painting && tap) rest();
    app.viewer.onStroke = painting ? clamp.paint : null;
    app.viewer.onClick = basis && !painting ? strike : null;
    showHeld(app, making.open ? clamp.vertices : basis?.kind === "vibration_basis" && Array.isArray(basis.parameters.clamped) ? basis.parameters.clamped : []);
  };
  making.addEventListener("toggle", () => app.panel?.id === "vibration" && prepare());

  const panel: Panel = {
    id: "vibration",
    title: "Vibration",
    about: "The surface as a thin shell of some material: tap it, watch it ring, and hear it.",
    guide: "vibration",
    kind: "vibration_basis",
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      const basis = app.basis;
      body.hidden = basis === null;
      look.show(null);
      app.title.textContent = app.mesh?.name ?? "";
      prepare();
      if (!basis) return;
      const all = frequencies(basis).slice(rigid(basis));
      facts.textContent = `${plural(all.length, "mode")} from ${brief(all[0])} to ${brief(all[all.length - 1])} Hz; ${grouped(rigid(basis))} rigid${held(basis) ? `; clamped at ${plural(held(basis), "vertex", "vertices")}` : ""}.`;
      plot.draw();
    },
    hide() {
      rest();
      last = null;
      playing?.stop();
      playing = null;
      app.viewer.onClick = app.viewer.onStroke = null;
      app.viewer.overlay("held", null);
      delete document.body.dataset.vibrating;
      delete document.body.dataset.heard;
    },
  };
  return panel;
}

/** Takes the rigid motion out of a displacement: a free body that is tapped flies away, which is not what one wants to see. */
function withoutRigid(rest: Float32Array, moved: Float32Array) {
  const n = rest.length / 3;
  const centre = [0, 0, 0], mean = [0, 0, 0];
  for (let i = 0; i < rest.length; i++) {
    centre[i % 3] += rest[i] / n;
    mean[i % 3] += moved[i] / n;
  }
  // ω from I ω = Σ r × u, with the inertia of the vertices.
  let xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0, tx = 0, ty = 0, tz = 0;
  for (let i = 0; i < rest.length; i += 3) {
    const x = rest[i] - centre[0], y = rest[i + 1] - centre[1], z = rest[i + 2] - centre[2];
    const u = moved[i] - mean[0], v = moved[i + 1] - mean[1], w = moved[i + 2] - mean[2];
    xx += y * y + z * z; yy += x * x + z * z; zz += x * x + y * y;
    xy -= x * y; xz -= x * z; yz -= y * z;
    tx += y * w - z * v; ty += z * u - x * w; tz += x * v - y * u;
  }
  const a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
  const determinant = xx * a + xy * b + xz * c || 1;
  const d = xx * zz - xz * xz, e = xy * xz - xx * yz, f = xx * yy - xy * xy;
  const ox = (a * tx + b * ty + c * tz) / determinant;
  const oy = (b * tx + d * ty + e * tz) / determinant;
  const oz = (c * tx + e * ty + f * tz) / determinant;
  for (let i = 0; i < rest.length; i += 3) {
    const x = rest[i] - centre[0], y = rest[i + 1] - centre[1], z = rest[i + 2] - centre[2];
    moved[i] -= mean[0] + oy * z - oz * y;
    moved[i + 1] -= mean[1] + oz * x - ox * z;
    moved[i + 2] -= mean[2] + ox * y - oy * x;
  }
}

/** The form of a vibration basis: a shell of some material, as large as one says. */
function form(app: App, clamp: Clamp): HTMLElement {
  const count = h("input", { type: "number", min: "7", max: "500", value: "40" });
  const material = choice(Object.entries(MATERIALS).map(([key, { name }]) => [key, name]), "bronze", () => {});
  const size = h("input", { type: "number", min: "0.01", max: "100", step: "any", value: "0.3" });
  const thickness = h("input", { type: "number", min: "0.01", max: "50", step: "any", value: "4" });
  const parameters = (whole = true): Parameters<"vibration_basis"> => {
    const { young, poisson, density } = MATERIALS[material.value];
    // Meshes have no unit of length. With one unit as s metres, frequencies stay right where Young's modulus is divided by s².
    const metres = size.valueAsNumber / (2 * app.viewer.radius);
    return {
      count: count.valueAsNumber,
      thickness: thickness.valueAsNumber / 1000 / metres,
      material: { young: young / metres ** 2, poisson, density },
      ...(whole && clamp.vertices.length > 0 ? { clamped: clamp.vertices } : {}),
    };
  };
  const made = h("form", { class: "form", onsubmit: (event: Event) => {
    event.preventDefault();
    void app.submit("vibration_basis", parameters());
  } }, field("Modes", count), field("Material", material), field("Size, m", size, "The diameter of the surface"), field("Wall, mm", thickness, "The thickness of the shell"), clamp.element,
    h("button", { class: "primary" }, "Compute"));
  made.append(expected(app, made, "vibration_basis", () => parameters(false), () => parameters()));
  return made;
}

function paint({ context: c, width, height, ink, faint, accent }: Frame, frequencies: number[]) {
  const most = frequencies[frequencies.length - 1] || 1;
  const x = (value: number) => 8 + ((width - 16) * value) / most;
  c.strokeStyle = faint;
  c.beginPath();
  c.moveTo(8, height - 20);
  c.lineTo(width - 8, height - 20);
  c.stroke();
  c.strokeStyle = accent;
  for (const value of frequencies) {
    c.beginPath();
    c.moveTo(x(value), height - 20);
    c.lineTo(x(value), 10);
    c.stroke();
  }
  c.fillStyle = ink;
  c.textBaseline = "middle";
  c.textAlign = "left";
  c.fillText("0", 8, height - 9);
  c.textAlign = "right";
  c.fillText(`${brief(most)} Hz`, width - 8, height - 9);
}
