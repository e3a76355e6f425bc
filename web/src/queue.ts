// Jobs on the screen: a card for each, and the list of all of them, which is reached from everywhere.

import { ended, get, type Job, type Mesh } from "./api";
import type { App } from "./app";
import { choice, field, h, plural, seconds, words } from "./dom";

const STATES: Record<Job["status"], string> = { enqueued: "waiting", processing: "running", succeeded: "done", failed: "failed", canceled: "cancelled" };

/** Puts new elements in the place of old ones; what has the focus keeps it, found by its place within its card. */
export function renew(list: HTMLElement, cards: HTMLElement[]) {
  const focused = document.activeElement;
  const card = focused instanceof HTMLElement && list.contains(focused) ? focused.closest<HTMLElement>("[data-job]") : null;
  const [id, name] = [card?.dataset.job, focused?.textContent];
  list.replaceChildren(...cards);
  if (!id) return;
  const again = list.querySelector<HTMLElement>(`[data-job="${id}"]`);
  const buttons = [...(again?.querySelectorAll<HTMLButtonElement>("button:not(:disabled)") ?? [])];
  (buttons.find(({ textContent }) => textContent === name) ?? buttons[0] ?? list).focus();
}

/** Names of meshes that no list holds. */
const names = new Map<string, string | null>();

/** What a job is of, for people. */
const subject = (app: App, job: Job) => job.mesh === null ? "matrices" : nameOf(app, job.mesh);

function nameOf(app: App, id: string): string {
  const known = app.meshes.find((mesh) => mesh.id === id)?.name ?? names.get(id);
  if (known === undefined) {
    names.set(id, null);
    get<Mesh>(`/v1/meshes/${id}`).then(({ name }) => {
      names.set(id, name ?? null);
      app.emit("jobs");
    }, () => {});
  }
  return known ?? `mesh ${id.slice(0, 8)}`;
}

/** What is asked for, in a few words. */
function what(job: Job): string {
  const { parameters } = job;
  if (job.kind === "eigenbasis" && "count" in parameters && parameters.count) return `${words(job.kind)}, ${plural(parameters.count, "pair")}`;
  if ("dimension" in parameters && parameters.dimension) return `${words(job.kind)}, ${parameters.dimension} columns`;
  if ("count" in parameters && parameters.count) return `${words(job.kind)}, ${plural(parameters.count, "mode")}`;
  return words(job.kind);
}

/** Seconds that a job has run, waited or taken. */
function time(job: Job): string {
  if (job.status === "enqueued") return `for ${seconds(Math.max((Date.now() - job.created_ms) / 1000, 0))}`;
  if (job.started_ms === null) return "";
  const spent = ((job.finished_ms ?? Date.now()) - job.started_ms) / 1000;
  return seconds(Math.max(spent, 0));
}

/** A job: what it is, where it stands, and what can be done about it. */
export function jobCard(app: App, job: Job, { dismiss = false, full = false } = {}): HTMLElement {
  const running = !ended(job.status);
  const place = app.jobs.place(job);
  const state = {
    ...STATES,
    enqueued: place === null ? "waiting for a worker" : place === 1 ? "next in the queue" : `number ${place} in the queue`,
    processing: [job.stage ? words(job.stage) : "starting", job.detail].filter(Boolean).join(" · "),
  }[job.status];
  const bar = h("progress", { max: 1, "aria-label": state });
  if (job.status === "processing" && job.progress !== null) bar.value = job.progress;
  const parts = [full ? STATES[job.status] : "", job.cancel_requested && running ? "stopping …" : state === STATES[job.status] && full ? "" : state, time(job),
    job.attempt > 1 ? `attempt ${job.attempt} of ${job.max_attempts}` : "", full ? new Date(job.created_ms).toLocaleString("en-GB") : ""];
  const card = h("div", { class: `card job ${job.status}`, "data-job": job.id },
    h("strong", {}, `${full ? what(job) : words(job.kind)} of ${subject(app, job)}`),
    job.status === "processing" && bar,
    h("small", {}, parts.filter(Boolean).join(" · ")),
    job.problem && h("p", {}, job.problem.detail));
  const buttons = h("div", { class: "row wrap" });
  const named = (text: string, act: () => unknown, rest: object = {}) => h("button", { "aria-label": `${text}: ${words(job.kind)} of ${subject(app, job)}`, onclick: act, ...rest }, text);
  if (running) buttons.append(named("Cancel", () => app.jobs.cancel(job), { disabled: job.cancel_requested }));
  else {
    if (full && job.status === "succeeded") buttons.append(named("Open", () => open(app, job)));
    if (job.status !== "succeeded") buttons.append(named("Try again", () => app.jobs.retry(job)));
    if (dismiss) buttons.append(named("Dismiss", () => app.jobs.dismiss(job), { class: "quiet" }));
    if (full) {
      // A job alone is soon made again; with its basis goes what took long.
      const sure = named(job.basis ? "Delete with its basis" : "Delete for good", () => app.removeJob(job), { class: "danger", hidden: true });
      buttons.append(named("Delete", () => {
        sure.hidden = false;
        sure.focus();
      }, { class: "quiet" }), sure);
    }
  }
  card.append(buttons);
  return card;
}

/** Goes to what a job made. */
function open(app: App, job: Job) {
  document.querySelector<HTMLDialogElement>("dialog.queue")?.close();
  const go = async () => {
    if (job.mesh === null) return app.toast("note", "Nothing to show", "This job is of matrices without a surface: its basis can be downloaded through the API.");
    if (app.mesh?.id !== job.mesh) await app.open(job.mesh);
    const panel = app.panels.find((panel) => panel.kind === job.kind && app.basesOf(panel).some(({ id }) => id === job.basis));
    if (!panel) return app.toast("note", "Nothing to open", "What this job made has been deleted.");
    app.go({ basis: job.basis ?? undefined });
    app.tab(panel.id);
  };
  go().catch(app.fail);
}

/** A button that tells how many jobs run, and the list that it opens. */
export function queue(app: App): { button: HTMLElement; dialog: HTMLElement } {
  const list = h("div", { class: "queue-list", tabIndex: -1 });
  const summary = h("p", { class: "dim", "aria-live": "polite" });
  let status = "";
  const more = h("button", { class: "quiet", hidden: true, onclick: () => app.jobs.look(true, status, true).catch(app.fail) }, "Older ones");
  const states = choice([["", "all"], ...Object.entries(STATES)], "", (value) => {
    status = value;
    app.jobs.look(true, status).catch(app.fail);
  });
  const dialog = h("dialog", { class: "queue", "aria-labelledby": "queue-title" },
    h("div", { class: "row head" }, h("h2", { id: "queue-title" }, "Jobs"), field("Show", states), h("button", { class: "quiet close", "aria-label": "Close the list of jobs", onclick: () => dialog.close() }, "×")),
    summary, list, more);
  const button = h("button", { class: "quiet jobs-button", onclick: () => {
    dialog.showModal();
    show();
    app.jobs.look(true, status).catch(app.fail);
  } }, "Jobs");
  dialog.addEventListener("close", () => void app.jobs.look(false));
  // A click beside the list closes it.
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  const show = () => {
    const { running } = app.jobs;
    button.textContent = running.length ? `Jobs · ${running.length}` : "Jobs";
    if (!dialog.open) return;
    const waiting = running.filter((job) => job.status === "enqueued").length;
    summary.textContent = `${running.length - waiting} running, ${waiting} waiting.`;
    // One that is about to be deleted is not taken away under the finger.
    const asked = list.querySelector<HTMLElement>("button.danger:not([hidden])")?.closest<HTMLElement>("[data-job]")?.dataset.job;
    const shown = app.jobs.newest.filter((job) => !status || job.status === status);
    renew(list, shown.length ? shown.map((job) => (job.id === asked && ended(job.status) ? list.querySelector<HTMLElement>(`[data-job="${asked}"]`)! : jobCard(app, job, { full: true }))) : [h("p", {}, "No jobs.")]);
    more.hidden = !app.jobs.more;
  };
  app.on("jobs", show);
  return { button, dialog };
}
