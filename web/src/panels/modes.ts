// Eigenfunctions: a slider over the modes, the spectrum, the certificate.

import { kept as numbered, numbers, recent, type Basis, type Eigenbasis } from "../api";
import type { App, Panel } from "../app";
import { brief, bytes, grouped, h, power, slider } from "../dom";
import { latest } from "../latest";
import { Plot, ticks, type Frame } from "../plot";
import { basisHead, certificate, eigenForm, line, vanishes } from "./basis";
import { comparison } from "./compare";
import { HodgeModes, ofFields } from "./hodge";
import { diverging, sequential, type Look } from "./look";

/** Modes kept in memory, by bytes. */
const KEPT = 64e6;

export function modesPanel(app: App, look: Look): Panel {
  const head = basisHead(app, () => panel, "basis", eigenForm(app, look));
  const body = h("div", { hidden: true });
  const facts = h("p", { class: "facts", "aria-live": "polite" });
  const proof = h("div", {});
  let playing = false;

  // --- modes ------------------------------------------------------------------------------------------------------------

  const kept = new Map<string, Float32Array>();
  const load = async (basis: Basis, mode: number): Promise<Float32Array> => {
    const path = `${basis.links.modes}?from=${mode}&to=${mode + 1}&format=f32`;
    // Also where nothing is asked, since it is known: this is the request behind what is shown.
    recent.shown = { method: "GET", path: numbered(path), accept: "application/octet-stream" };
    const name = `${basis.id}/${mode}`;
    const known = kept.get(name);
    if (known) {
      kept.delete(name);
      kept.set(name, known);
      return known;
    }
    const values = await numbers(path);
    kept.set(name, values);
    for (const [oldest] of kept) {
      if (kept.size * values.byteLength <= KEPT) break;
      kept.delete(oldest);
    }
    return values;
  };
  const request = latest<{ basis: Basis; mode: number }>(async ({ basis, mode }) => {
    const loaded = await load(basis, mode);
    const wanted = () => app.basis === basis && app.panel === panel;
    if (!wanted()) return;
    app.title.textContent = `Mode ${grouped(mode)}`;
    if (ofFields(basis)) {
      await hodge.show(basis, loaded, wanted);
      if (wanted()) document.body.dataset.mode = String(mode);
      return;
    }
    // Of a solid the vertices of its surface come first, and these are what is seen.
    const values = loaded.subarray(0, (app.viewer.resting?.length ?? 0) / 3);
    // The kernel is constant: it has no sign to show.
    const constant = values.every((value) => Math.abs(value - values[0]) <= 1e-3 * Math.abs(values[0]));
    const scalar = constant ? sequential(values) : diverging(values);
    look.show(scalar);
    amplitude = 0.12 / Math.max(Math.abs(scalar.range[0]), Math.abs(scalar.range[1]), 1e-30);
    if (app.swinging && !playing && !calm()) swing(true);
    app.swinging = false;
    document.body.dataset.mode = String(mode);
  }, (error) => {
    app.fail(error);
    if (app.panel !== panel) return;
    // The mode before would stand beside the eigenvalue of the one that could not be had.
    if (playing) swing(false);
    hodge.hide();
    look.show(null);
    app.title.textContent = app.mesh?.name ?? "";
    delete document.body.dataset.mode;
  });

  const hodge = new HodgeModes(app, look, (mode) => select(mode));
  const compare = comparison(app, (id) => line(app.bases.find((basis) => basis.id === id)!));
  let amplitude = 0;
  const mode = slider("Mode", { min: 0, max: 1, step: 1, value: 1 }, (value) => select(value), grouped);
  const back = h("button", { class: "quiet", "aria-label": "Previous mode", onclick: () => select(app.place.mode - 1) }, "‹");
  const next = h("button", { class: "quiet", "aria-label": "Next mode", onclick: () => select(app.place.mode + 1) }, "›");
  const play = h("button", { "aria-pressed": "false", onclick: () => swing(!playing) }, "Animate");

  const select = (wanted: number) => {
    const basis = app.basis;
    if (basis?.kind !== "eigenbasis") return;
    const k = Math.min(Math.max(wanted, 0), basis.count - 1);
    app.go({ mode: k });
    mode.set(k);
    const { residuals, bounds, estimates } = basis.certificate;
    const value = basis.eigenvalues[k];
    const zero = vanishes(basis, k);
    const percent = (error: number) => (zero ? brief(error) : `${brief((100 * error) / Math.abs(value))} %`);
    const part = hodge.part(basis, k);
    facts.replaceChildren(h("b", {}, `λ = ${brief(value)}`), part && ` ${part},`, estimates?.length ? ` error about ${percent(estimates[k])}, within ${percent(bounds[k])}` : ` ± ${percent(bounds[k])}`,
      h("span", { class: "dim" }, estimates?.length ? "" : `residual ${brief(residuals[k])}`));
    plot.draw();
    request({ basis, mode: k });
  };
  const swing = (on: boolean) => {
    playing = on;
    play.setAttribute("aria-pressed", String(on));
    const still = calm() ? 0.3 : 1;
    if (on) {
      app.viewer.animate((time) => {
        app.viewer.wave(amplitude * Math.sin(4 * still * time));
        return playing;
      });
    } else {
      app.viewer.animate(null);
      app.viewer.wave(null);
    }
  };
  document.addEventListener("keydown", (event) => {
    if (app.panel !== panel || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLInputElement && event.target.type !== "range") return;
    if (event.key === "[" || event.key === "]") select(app.place.mode + (event.key === "]" ? 1 : -1));
  });

  // --- spectrum ---------------------------------------------------------------------------------------------------------

  const plot = new Plot(190, "The spectrum: eigenvalues with bounds above, below them estimated errors or residuals. Click to choose a mode.", (frame) => app.basis?.kind === "eigenbasis" && spectrum(frame, app.basis, app.place.mode));
  const under = (event: PointerEvent) => {
    const basis = app.basis;
    if (!basis) return;
    const [x] = plot.at(event);
    select(Math.round(((x - LEFT) / (plot.canvas.clientWidth - LEFT - RIGHT)) * (basis.count - 1)));
  };
  plot.canvas.addEventListener("pointerdown", (event) => {
    plot.canvas.setPointerCapture(event.pointerId);
    under(event);
  });
  plot.canvas.addEventListener("pointermove", (event) => event.buttons && under(event));

  body.append(
    h("div", { class: "modes" }, back, mode.element, next), facts, hodge.element, h("div", { class: "row" }, play, h("span", { class: "dim hint" }, "keys [ and ]")), look.element,
    h("h3", {}, "Spectrum"), plot.canvas, h("h3", {}, "Certificate"), proof, compare.element);

  const panel: Panel = {
    id: "modes",
    title: "Modes",
    about: "The standing waves of the surface, from the longest to the finest: the eigenfunctions of its Laplacian.",
    guide: "certificates",
    kind: "eigenbasis",
    element: h("div", { class: "panel" }, head.element, body),
    show() {
      head.update();
      const basis = app.basis?.kind === "eigenbasis" ? app.basis : null;
      body.hidden = basis === null;
      if (!basis) {
        app.title.textContent = app.mesh?.name ?? "";
        look.show(null);
        return;
      }
      body.insertBefore(look.element, body.querySelector("h3"));
      mode.control.max = String(basis.count - 1);
      const name = `${app.mesh?.name ?? "mesh"}-${basis.count}-${basis.id.slice(0, 8)}`;
      proof.replaceChildren(certificate(basis), h("p", {}, app.link(`Download as NPZ (${bytes(basis.bytes)})`, basis.links.content, `${name}.npz`), " · ", app.link("metadata", basis.links.self, `${name}.json`)));
      play.hidden = ofFields(basis);
      hodge.hide();
      hodge.offer(basis, () => app.place.mode);
      compare.update();
      select(app.place.mode);
    },
    hide() {
      if (playing) swing(false);
      hodge.hide();
      delete document.body.dataset.mode;
    },
  };
  return panel;
}

/** Whether whoever looks wants little motion: nothing begins to move by itself then. */
const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

const LEFT = 46, RIGHT = 8;

/** Eigenvalues with their bounds, and estimated errors or residuals on a logarithmic scale under them. */
function spectrum({ context: c, width, height, ink, write, faint, accent, second }: Frame, basis: Eigenbasis, mode: number) {
  const { eigenvalues, certificate: { bounds, estimates, residuals } } = basis;
  const m = eigenvalues.length;
  const split = Math.round(height * 0.64);
  const x = (k: number) => LEFT + ((width - LEFT - RIGHT) * k) / Math.max(m - 1, 1);
  const top = 8, bottom = split - 16;
  const most = eigenvalues[m - 1] * 1.02 || 1;
  const y = (value: number) => bottom - ((bottom - top) * Math.min(Math.max(value, 0), most * 1.05)) / most;
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (const value of ticks(0, most, 3)) {
    c.strokeStyle = faint;
    c.beginPath();
    c.moveTo(LEFT, y(value));
    c.lineTo(width - RIGHT, y(value));
    c.stroke();
    c.fillStyle = ink;
    c.fillText(brief(value), LEFT - 5, y(value));
  }
  // Bounds as a band, values as a line with points where there is room for them.
  c.fillStyle = accent;
  c.globalAlpha = 0.22;
  c.beginPath();
  for (let k = 0; k < m; k++) c.lineTo(x(k), y(eigenvalues[k] + bounds[k]));
  for (let k = m - 1; k >= 0; k--) c.lineTo(x(k), y(eigenvalues[k] - bounds[k]));
  c.fill();
  c.globalAlpha = 1;
  const size = m > 150 ? 1.2 : 2;
  for (let k = 0; k < m; k++) {
    c.beginPath();
    c.arc(x(k), y(eigenvalues[k]), size, 0, 7);
    c.fill();
  }
  c.textAlign = "right";
  write("λ, and its bound", width - RIGHT, bottom - 8);
  // Errors or residuals.
  const below = estimates?.length ? estimates.map((error, k) => error / Math.max(Math.abs(eigenvalues[k]), 1e-300)) : residuals;
  const shown = below.map((value) => Math.log10(Math.min(Math.max(value, 1e-16), 10)));
  // What is relative to zero says nothing about the others.
  const counted = shown.filter((_, k) => !vanishes(basis, k));
  const rest = counted.length ? counted : shown;
  const low = Math.floor(Math.min(...rest)), high = Math.max(Math.ceil(Math.max(...rest)), low + 1);
  const base = height - 6;
  const z = (value: number) => base - ((base - split) * (Math.min(Math.max(value, low), high) - low)) / (high - low);
  c.strokeStyle = faint;
  c.beginPath();
  c.moveTo(LEFT, base);
  c.lineTo(width - RIGHT, base);
  c.moveTo(LEFT, split);
  c.lineTo(width - RIGHT, split);
  c.stroke();
  c.fillStyle = ink;
  c.textAlign = "right";
  c.fillText(power(high), LEFT - 5, split + 2);
  c.fillText(power(low), LEFT - 5, base - 3);
  c.fillStyle = second;
  for (let k = 0; k < m; k++) c.fillRect(x(k) - size / 2, z(shown[k]) - size / 2, size + 0.6, size + 0.6);
  c.textAlign = "right";
  write(estimates?.length ? "relative error, estimated" : "residual", width - RIGHT, split + 8);
  // The mode that is shown.
  c.strokeStyle = c.fillStyle = ink;
  c.beginPath();
  c.moveTo(x(mode), top);
  c.lineTo(x(mode), base);
  c.globalAlpha = 0.5;
  c.stroke();
  c.globalAlpha = 1;
  c.beginPath();
  c.arc(x(mode), y(eigenvalues[mode]), 4, 0, 7);
  c.fill();
}
