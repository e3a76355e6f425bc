// Requests as code to take along: at the foot of every tab what it asked for last and the job behind its basis, under every form the job that it would send.

import { kept, recent } from "./api";
import type { App, Panel } from "./app";
import { curl, python, type Request } from "./code";
import { h } from "./dom";

/** Puts a text on the clipboard. */
async function copy(app: App, text: string, what: string) {
  try {
    await navigator.clipboard.writeText(text);
    app.toast("note", "Copied", `${what} is on the clipboard.`);
  } catch {
    // Without the right to the clipboard, the text can still be taken by hand.
    const box = h("textarea", { class: "by-hand", readOnly: true, rows: 8, "aria-label": `${what}: copy it from here` });
    box.value = text;
    box.addEventListener("blur", () => box.remove());
    document.body.append(box);
    box.focus();
    box.select();
  }
}

/** A row of buttons, one for each language. What is copied is made when one of them is pressed. */
export function asCode(app: App, what: string, request: () => Request | null | Promise<Request | null>): HTMLElement {
  const button = (language: string, write: (request: Request) => string) =>
    h("button", { type: "button", class: "quiet", "aria-label": `Copy the ${what} as ${language}`, onclick: async () => {
      try {
        const found = await request();
        if (found) return await copy(app, write(found), `The ${what} ${language === "curl" ? "for" : "in"} ${language}`);
      } catch (error) {
        return app.fail(error);
      }
      app.toast("note", "Nothing to copy yet", "This tab has not asked the server for anything so far.");
    } }, language);
  return h("div", { class: "row code", role: "group", "aria-label": `Copy the ${what}` }, h("span", { class: "dim" }, `Copy the ${what} as`), button("curl", curl), button("Python", python));
}

/** A job as one submits it oneself. */
export const jobRequest = (kind: string, mesh: string | null, parameters: unknown): Request => ({ method: "POST", path: kept("/v1/jobs", "POST"), body: { kind, mesh, parameters } });

/** Whether these parameters are all there: of long lists the server keeps only a hash beside a basis. */
const whole = (value: unknown): boolean =>
  !value || typeof value !== "object" || ((Array.isArray(value) || !("blake3" in value)) && Object.values(value).every(whole));

/** The foot of a tab. */
export function codeFoot(app: App, panel: Panel): HTMLElement {
  const basis = () => (panel.kind !== undefined && app.basis?.kind === panel.kind && whole(app.basis.parameters) ? app.basis : null);
  const job = asCode(app, "job", () => {
    const found = basis();
    return found && jobRequest(found.kind, found.mesh, found.parameters);
  });
  const foot = h("div", { class: "foot", hidden: true }, asCode(app, "request", () => recent.shown), job);
  const update = () => {
    // Where a basis is needed and there is none, the form under which a job can be copied is all there is.
    foot.hidden = app.mesh === null || (panel.kind !== undefined && app.basis?.kind !== panel.kind);
    job.hidden = basis() === null;
  };
  for (const happening of ["basis", "mesh", "tab"] as const) app.on(happening, update);
  return foot;
}
