// The list of jobs.

import assert from "node:assert/strict";
import { kit } from "./kit.mjs";

export async function queue(site) {
  const { test, keep, opened, violations } = kit(site);
  const page = await site.open();
  const api = (path, init) => fetch(site.url + path, init).then((response) => (response.status === 204 ? null : response.json()));
  // Of counts that take minutes, so that none is done before it is cancelled.
  const submit = (mesh, count) => api("/v1/jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ kind: "eigenbasis", mesh, parameters: { count, method: "hsim", tolerance: 1e-9 } }) });
  const card = (id) => page.locator(`dialog.queue [data-job="${id}"]`);
  const gone = (id, state) => page.waitForFunction(([id, state]) => document.querySelector(`dialog.queue [data-job="${id}"]`)?.classList.contains(state), [id, state]);
  let jobs = [];

  await test("the list of jobs tells what runs, what waits, and at which place", async () => {
    await opened(page, "long", "sphere", 40_000);
    const mesh = await page.evaluate(() => window.chladni.app.mesh.id);
    const open = new Set();
    const most = { streams: 0 };
    page.on("request", (request) => {
      if (request.url().endsWith("/events")) open.add(request);
      most.streams = Math.max(most.streams, open.size);
    });
    for (const event of ["requestfinished", "requestfailed"]) page.on(event, (request) => open.delete(request));
    for (let k = 0; k < 8; k++) jobs.push(await submit(mesh, 2000 + k));
    await page.getByRole("button", { name: /^Jobs/ }).click();
    for (const { id } of jobs) await card(id).waitFor();
    // How many run at once is the server's affair; as it says, so says the page.
    await page.waitForFunction(async () => {
      const list = async (status) => (await (await fetch(`/v1/jobs?status=${status}&limit=200`)).json()).items;
      const [waiting, running] = [await list("enqueued"), await list("processing")];
      if (running.length === 0) return false;
      const text = ({ id }) => document.querySelector(`dialog.queue [data-job="${id}"] small`)?.textContent ?? "";
      const places = waiting.slice().reverse().map((job, k) => text(job).includes(k === 0 ? "next in the queue" : `number ${k + 1} in the queue`));
      return waiting.length >= 2 && places.every(Boolean) && running.every((job) => /^running/.test(text(job)));
    });
    assert.match(await page.locator("dialog.queue > p").innerText(), /^\d+ running, \d+ waiting\.$/);
    await keep(page, "jobs");
    // With eight of them, the page still gets answers.
    assert.ok(most.streams >= 1 && most.streams <= 2, `${most.streams} streams of events`);
    assert.equal(await page.evaluate(async () => (await fetch("/v1/meshes")).status), 200);
  });

  await test("what another client submits appears while one looks", async () => {
    const mesh = await page.evaluate(() => window.chladni.app.mesh.id);
    const job = await submit(mesh, 2020);
    await card(job.id).waitFor();
    jobs.push(job);
  });

  await test("jobs are cancelled, tried again and deleted, with the keyboard too", async () => {
    for (const { id } of jobs.slice().reverse()) {
      await card(id).getByRole("button", { name: /^Cancel/ }).press("Enter");
      await gone(id, "canceled");
    }
    const [{ id }] = jobs;
    await card(id).getByRole("button", { name: /^Try again/ }).click();
    await card(id).getByRole("button", { name: /^Cancel/ }).click();
    await gone(id, "canceled");
    assert.equal((await api(`/v1/jobs/${id}`)).status, "canceled");
    await card(id).getByRole("button", { name: /^Delete:/ }).click();
    await card(id).getByRole("button", { name: /^Delete for good/ }).click();
    await card(id).waitFor({ state: "detached" });
    assert.equal((await api(`/v1/jobs/${id}`)).status, 404);
  });

  await test("a job that is done leads to its result, from wherever one is", async () => {
    await page.keyboard.press("Escape");
    await opened(page, "short", "torus", 770, 40);
    await page.getByRole("tab", { name: "Shapes" }).click();
    await page.getByRole("button", { name: /^Jobs/ }).click();
    await page.locator("dialog.queue").getByRole("combobox", { name: "Show" }).selectOption("succeeded");
    await page.waitForFunction(() => document.querySelectorAll("dialog.queue .card").length > 0 && !document.querySelector("dialog.queue .card:not(.succeeded)"));
    await page.getByRole("button", { name: "Open: eigenbasis of short" }).click();
    await page.waitForFunction(() => document.body.dataset.mode !== undefined && window.chladni.app.mesh.name === "short");
    assert.ok(await page.locator("dialog.queue").isHidden());
  });

  await test("with a job goes its basis, here too", async () => {
    const basis = await page.evaluate(() => window.chladni.app.basis.id);
    await page.getByRole("button", { name: /^Jobs/ }).click();
    await page.getByRole("button", { name: "Delete: eigenbasis of short" }).click();
    await page.getByRole("button", { name: "Delete with its basis: eigenbasis of short" }).click();
    await page.waitForFunction((basis) => window.chladni.app.basis?.id !== basis && !window.chladni.app.bases.some(({ id }) => id === basis), basis);
    assert.equal((await api(`/v1/bases/${basis}`)).status, 404);
    await page.keyboard.press("Escape");
  });

  await test("the list breaks no rule of WCAG 2.2 AA, fits a phone, and gives the focus back", async () => {
    const button = page.getByRole("button", { name: /^Jobs/ });
    await button.press("Enter");
    await page.locator("dialog.queue").getByRole("combobox", { name: "Show" }).selectOption("");
    await page.locator("dialog.queue .card.canceled").first().waitFor();
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      assert.deepEqual(await violations(page), []);
    }
    await keep(page, "jobs-dark");
    await page.setViewportSize({ width: 390, height: 844 });
    assert.ok(await page.evaluate(() => document.querySelector("dialog.queue").getBoundingClientRect().right <= 390 && document.documentElement.scrollWidth <= 390));
    await keep(page, "jobs-phone");
    await page.keyboard.press("Escape");
    assert.equal(await page.evaluate(() => document.activeElement.textContent), await button.innerText());
  });
  await page.context().close();
}
