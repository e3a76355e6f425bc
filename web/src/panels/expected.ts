// What a job will take, told before it is sent.

import { ApiError, post, type Kind, type Parameters } from "../api";
import type { App } from "../app";
import { asCode, jobRequest } from "../copy";
import { bytes, h, seconds } from "../dom";
import { latest } from "../latest";

interface Estimate {
  seconds: number | null;
  threads: number;
  memory_bytes: number;
  memory_limit_bytes: number;
  fits: boolean;
}

/** Longer than this is worth a warning, in seconds. */
const LONG = 30;

/**
 * What stands under a form: time and memory of the job that it would send, as `parameters` say, which follows what is typed; and that job to be copied as code.
 * `sent` gives the parameters with all lists, or promises them, where they are longer than an estimate needs; null where there is nothing to be sent.
 */
export function expected<K extends Kind>(app: App, form: HTMLFormElement, kind: K, parameters: () => Parameters<K>, sent: () => unknown = parameters): HTMLElement {
  const line = h("p", { class: "dim expected", "aria-live": "polite" });
  const ask = latest<Parameters<K>>(async (wish) => {
    const mesh = app.mesh?.id;
    if (!mesh) return;
    try {
      const found = await post<Estimate>("/v1/job-estimates", { kind, mesh, parameters: wish });
      if (mesh !== app.mesh?.id) return;
      const time = found.seconds === null ? "" : `about ${seconds(Math.max(found.seconds, 0.1))} of one core, `;
      line.textContent = found.fits ? `Takes ${time}up to ${bytes(found.memory_bytes)}.` : `Needs ${bytes(found.memory_bytes)}; this server allows ${bytes(found.memory_limit_bytes)}.`;
      line.classList.toggle("unproven", !found.fits || (found.seconds ?? 0) > LONG);
    } catch (error) {
      // What is wrong with the parameters is told in the same place, and again where they are sent all the same.
      if (!(error instanceof ApiError)) throw error;
      line.textContent = error.problem.detail;
      line.classList.add("unproven");
    }
  }, app.fail);
  let pause = 0;
  const soon = () => {
    window.clearTimeout(pause);
    pause = window.setTimeout(() => form.isConnected && form.offsetParent !== null && ask(parameters()), 150);
  };
  form.addEventListener("input", soon);
  form.addEventListener("change", soon);
  for (const happening of ["mesh", "tab"] as const) app.on(happening, soon);
  // A form that is unfolded asks too.
  new ResizeObserver(soon).observe(form);
  return h("div", {}, line, asCode(app, "new job", async () => {
    const mesh = app.mesh?.id;
    const wish = mesh && (await sent());
    return wish ? jobRequest(kind, mesh, wish) : null;
  }));
}
