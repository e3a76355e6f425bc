// The viewer where there is no server: one script that shows modes on a surface. The Python package puts it into a notebook, with the numbers beside it.

import { gradient, MAPS } from "./colours";
import { brief, grouped, h, slider } from "./dom";
import { prepare } from "./geometry";
import { Viewer } from "./viewer";

/** What stands beside the script, in the element `data`. Arrays are base64 of little-endian numbers. */
interface Given {
  /** Two counts, positions and triangles, as `application/vnd.chladni.mesh` has them. */
  surface: string;
  /** A value for each vertex, mode after mode. */
  modes: string;
  values: number[];
  /** The mode to begin with. */
  first: number;
  /** Whether the surface bounds a solid, so that its inner side is never seen. */
  closed: boolean;
}

const MAP = "blue-orange";
/** How far a mode swings, in the radius of the surface. */
const SWING = 0.12;

const bytes = (text: string) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

function start({ surface, modes: packed, values, first, closed }: Given) {
  const prepared = prepare(bytes(surface));
  const modes = new Float32Array(bytes(packed));
  const count = prepared.positions.length / 3;
  const canvas = h("canvas", { class: "surface", tabIndex: 0, role: "application", "aria-label": "The surface; arrow keys turn it" });
  const ends = h("div", { class: "labels" }, h("span", {}), h("span", {}, "0"), h("span", {}));
  const ramp = h("span", { class: "ramp" });
  ramp.style.background = gradient(MAPS[MAP]);
  const stage = h("main", { class: "stage" }, canvas, h("div", { class: "legend" }, ramp, ends));
  document.body.append(stage);
  let viewer: Viewer;
  try {
    viewer = new Viewer(canvas);
  } catch {
    stage.replaceChildren(h("p", {}, "This browser does not offer WebGL 2."));
    return;
  }
  viewer.setMesh(prepared, closed);
  viewer.map(MAP);
  viewer.lines(16);
  let amplitude = 0;
  const told = h("output", { class: "value" });
  const show = (mode: number) => {
    const shown = modes.subarray(mode * count, (mode + 1) * count);
    let most = 0;
    for (const value of shown) most = Math.max(most, Math.abs(value));
    viewer.setScalar({ values: shown, range: [-most, most], diverging: true });
    amplitude = SWING / (most || 1);
    told.textContent = `λ = ${brief(values[mode])}`;
    [ends.firstElementChild!.textContent, ends.lastElementChild!.textContent] = [brief(-most), brief(most)];
    document.body.dataset.mode = String(mode);
  };
  const mode = slider("Mode", { min: 0, max: values.length - 1, step: 1, value: first }, show, grouped);
  const play = h("button", { "aria-pressed": "false", onclick: () => {
    const on = play.getAttribute("aria-pressed") !== "true";
    play.setAttribute("aria-pressed", String(on));
    viewer.animate(on ? (time) => {
      viewer.wave(amplitude * Math.sin(4 * time));
      return true;
    } : null);
    if (!on) viewer.wave(null);
  } }, "Animate");
  document.body.append(h("div", { class: "bar" }, mode.element, told, play));
  show(first);
  // For tests and for whoever looks from the console.
  Object.assign(window, { chladni: { viewer } });
}

start(JSON.parse(document.getElementById("data")!.textContent!) as Given);
