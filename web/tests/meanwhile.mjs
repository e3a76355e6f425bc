// What happens meanwhile: answers that come late, and what others make and delete while one looks.

import assert from "node:assert/strict";
import { start } from "./harness.mjs";
import { kit } from "./kit.mjs";

/** On a server of its own: what is stored there already would keep its name. */
export async function meanwhile() {
  const site = await start();
  try {
    await tests(site);
  } finally {
    await site.stop();
  }
}

async function tests(site) {
  const { test, opened } = kit(site);
  const page = await site.open();
  const api = (path, method = "GET", body = undefined) =>
    fetch(site.url + path, { method, body: body && JSON.stringify(body), headers: { "Content-Type": "application/json" } }).then((response) => (response.status === 204 ? null : response.json()));
  const ids = () => page.evaluate(() => Object.fromEntries(window.chladni.app.meshes.map(({ name, id }) => [name, id])));
  const shown = () => page.evaluate(() => [window.chladni.app.mesh?.name ?? null, window.chladni.app.basis?.id ?? null]);
  const close = async () => {
    while (await page.locator(".toast").count()) await page.getByRole("button", { name: "Close" }).first().click();
  };
  /** Holds requests back until it is told to let them go on; tells when the first one has come. */
  const held = async (pattern, method) => {
    let release = () => {}, come = () => {};
    const [free, come_] = [new Promise((resolve) => (release = resolve)), new Promise((resolve) => (come = resolve))];
    await page.route(pattern, async (route) => {
      if (route.request().method() !== method) return route.fallback();
      come();
      await free;
      await route.continue();
    });
    return { come: come_, release: async () => {
      const answered = page.waitForResponse((response) => response.request().method() === method && response.url().match(pattern));
      release();
      await (await answered).finished();
      await page.unroute(pattern);
    } };
  };

  await test("a curve that is set back stays set back, whatever answer was under way", async () => {
    await opened(page, "one", "torus", 600, 30);
    await opened(page, "two", "sphere", 600, 30);
    await page.getByRole("tab", { name: "Filter" }).click();
    const late = await held(/\/filter\?/, "POST");
    await page.getByRole("button", { name: "Smooth" }).click();
    await late.come;
    await page.getByRole("button", { name: "Original" }).click();
    await late.release();
    await page.getByRole("tab", { name: "Modes" }).click();
    await page.waitForFunction(() => document.body.dataset.mode);
    await page.getByRole("tab", { name: "Filter" }).click();
    await page.getByText("Nothing is changed yet").waitFor();
    assert.ok(await page.evaluate(() => window.chladni.viewer.surface.positions === window.chladni.viewer.resting));
    // In the same way, but without leaving the tab.
    const again = await held(/\/filter\?/, "POST");
    await page.getByRole("button", { name: "Smooth" }).click();
    await again.come;
    await page.getByRole("button", { name: "Original" }).click();
    await again.release();
    await page.evaluate(() => new Promise((resolve) => setTimeout(resolve)));
    assert.ok(await page.evaluate(() => window.chladni.viewer.surface.positions === window.chladni.viewer.resting));
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("what is opened while another gets its name, or is deleted, stays open", async () => {
    const { one, two } = await ids();
    const naming = await held(/\/v1\/meshes\//, "PATCH");
    const renamed = page.evaluate(() => window.chladni.app.rename("second"));
    await naming.come;
    await page.evaluate((id) => window.chladni.app.open(id), one);
    await naming.release();
    await renamed;
    assert.equal(await page.evaluate(() => window.chladni.app.mesh.id), one);
    assert.ok((await ids()).second);
    await page.evaluate((id) => window.chladni.app.open(id), two);
    await opened(page, "three", "disk", 300);
    const deleting = await held(/cascade=true/, "DELETE");
    const deleted = page.evaluate(() => window.chladni.app.remove());
    await deleting.come;
    await page.evaluate((id) => window.chladni.app.open(id), one);
    await deleting.release();
    await deleted;
    assert.deepEqual([(await shown())[0], Object.keys(await ids())], ["one", ["second", "one"]]);
    await close();
  });

  await test("an address leads to a basis that was made elsewhere, and says where there is none", async () => {
    const { one } = await ids();
    const job = await api("/v1/jobs", "POST", { kind: "eigenbasis", mesh: one, parameters: { count: 12 } });
    let basis = null;
    // The server tells when the job has ended.
    await fetch(site.url + job.links.events).then((response) => response.text());
    ({ basis } = await api(job.links.self));
    await page.evaluate((hash) => (location.hash = hash), `#mesh=${one}&basis=${basis}&tab=modes&mode=3`);
    await page.waitForFunction((basis) => window.chladni.app.basis?.id === basis && document.body.dataset.mode === "3", basis);
    await page.evaluate((hash) => (location.hash = hash), `#mesh=${one}&basis=${basis.replace(/.{4}$/, "0000")}&tab=modes&mode=3`);
    await page.getByText("That basis is not there").waitFor();
    await close();
  });

  await test("an address of what is gone opens its tab all the same, and then says what is shown", async () => {
    const nowhere = "0".repeat(32);
    const visitor = await site.open(`/#mesh=${nowhere}&tab=points`);
    await visitor.getByRole("alert").getByText("There is no such mesh").waitFor();
    await visitor.locator("#panel-points").waitFor();
    assert.ok(!(await visitor.evaluate(() => location.hash)).includes(nowhere));
    await visitor.context().close();
    const { one } = await ids();
    await page.evaluate((hash) => (location.hash = hash), `#mesh=${nowhere}&tab=modes`);
    await page.getByRole("alert").getByText("There is no such mesh").waitFor();
    await page.waitForFunction((one) => location.hash.includes(one), one);
    assert.equal((await shown())[0], "one");
    await close();
  });

  await test("a basis that others delete gives way to another, and nothing of it stays", async () => {
    const { one } = await ids();
    await page.evaluate((id) => window.chladni.app.open(id), one);
    await page.waitForFunction(() => document.body.dataset.mode);
    const { items } = await api(`/v1/jobs?limit=50`);
    const [, basis] = await shown();
    await api(`/v1/jobs/${items.find((job) => job.basis === basis).id}?cascade=true`, "DELETE");
    await page.getByRole("button", { name: "Next mode" }).click();
    await page.getByRole("alert").getByText("There is no such basis").waitFor();
    await page.waitForFunction((basis) => window.chladni.app.basis && window.chladni.app.basis.id !== basis && document.body.dataset.mode, basis);
    assert.ok(!(await page.evaluate(() => location.hash)).includes(basis));
    await close();
    // What the server does not give is not shown under its name either.
    await page.route(/\/modes\?/, (route) => route.fulfill({ status: 500, contentType: "application/problem+json", body: JSON.stringify({ type: "", title: "It broke", detail: "Nobody knows why." }) }));
    await page.getByRole("button", { name: "Next mode" }).click();
    await page.getByRole("alert").getByText("Nobody knows why.").waitFor();
    assert.ok(await page.locator(".legend").isHidden());
    await page.unroute(/\/modes\?/);
    await page.getByRole("button", { name: "Next mode" }).click();
    await page.waitForFunction(() => document.body.dataset.mode);
    assert.ok(await page.locator(".legend").isVisible());
    await close();
  });

  await test("a form that is being filled in stays, whatever job ends", async () => {
    const form = page.locator("#panel-modes .head details.new");
    await form.locator("summary").click();
    await form.getByLabel("Eigenpairs").fill("77");
    await page.evaluate(() => window.chladni.app.submit("eigenbasis", { count: 21 }));
    await page.waitForFunction(() => window.chladni.app.basis?.count === 21 && document.body.dataset.mode);
    assert.deepEqual([await form.evaluate(({ open }) => open), await form.getByLabel("Eigenpairs").inputValue()], [true, "77"]);
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "Eigenpairs");
    await form.locator("summary").click();
  });

  await test("an address that a browser refuses for a while is written later, and nothing else stops", async () => {
    const mode = await page.evaluate(async () => {
      // As Safari and Firefox do after some hundred changes within seconds.
      history.replaceState = () => {
        throw new DOMException("The operation is insecure.", "SecurityError");
      };
      document.querySelector("#panel-modes [aria-label='Next mode']").click();
      return window.chladni.app.place.mode;
    });
    await page.waitForFunction((mode) => document.body.dataset.mode === String(mode), mode);
    assert.ok(!(await page.evaluate(() => location.hash)).includes(`mode=${mode}&`));
    await page.evaluate(() => delete history.replaceState);
    await page.waitForFunction((mode) => new URLSearchParams(location.hash.slice(1)).get("mode") === String(mode), mode);
  });

  await test("a step back opens a surface once", async () => {
    const { one, second } = await ids();
    await page.evaluate((id) => window.chladni.app.open(id), one);
    await page.evaluate((id) => window.chladni.app.open(id), second);
    const asked = [];
    page.on("request", (request) => request.url().includes("/content") && asked.push(request.url()));
    await page.goBack();
    await page.waitForFunction((one) => window.chladni.app.mesh.id === one && document.querySelector(".busy").hidden, one);
    await page.waitForFunction(() => document.body.dataset.mode);
    assert.equal(asked.length, 1, asked.join("\n"));
  });

  await test("what others delete leaves the list as soon as one comes upon it", async () => {
    const { one, second } = await ids();
    await api(`/v1/meshes/${second}?cascade=true`, "DELETE");
    // It was open before, and the browser has kept its content.
    await page.locator("button.mesh", { hasText: "second" }).click();
    await page.getByRole("alert").getByText("There is no such mesh").waitFor();
    await page.waitForFunction(() => !window.chladni.app.meshes.some(({ name }) => name === "second"));
    assert.equal((await shown())[0], "one");
    await close();
    await api(`/v1/meshes/${one}?cascade=true`, "DELETE");
    await page.locator("li.open").getByRole("button", { name: "Delete" }).click();
    await page.locator("li.open .danger").click();
    await page.locator(".toast.note").getByText("Deleted").waitFor();
    await page.waitForFunction(() => window.chladni.app.mesh?.name !== "one");
    assert.equal(await page.locator(".toast.error").count(), 0);
    await close();
  });

  await test("a server that answers again is called unreachable no longer", async () => {
    await page.route("**/v1/**", (route) => route.abort());
    await page.evaluate(() => window.chladni.app.list().catch(window.chladni.app.fail));
    await page.getByRole("alert").getByText("The server cannot be reached").waitFor();
    await page.evaluate(() => window.chladni.app.toast("error", "Another", "This one stays."));
    await page.unroute("**/v1/**");
    await page.evaluate(() => window.chladni.app.list());
    assert.deepEqual(await page.locator(".toast strong").allInnerTexts(), ["Another"]);
    await close();
  });

  await test("a surface that no list holds is renamed and deleted all the same", async () => {
    await opened(page, "far down", "disk", 200);
    await page.evaluate(() => {
      const { app } = window.chladni;
      app.meshes = app.meshes.filter(({ name }) => name !== "far down");
      app.emit("meshes");
    });
    await page.locator("li.open strong").getByText("far down").waitFor();
    assert.equal(await page.locator("li.open").getByRole("button", { name: "Rename" }).count(), 1);
    // A file that comes is seen, whatever was searched for.
    await page.evaluate(() => (window.chladni.app.sought = "nothing of this name"));
    await page.setInputFiles("#file", { name: "corner.obj", mimeType: "model/obj", buffer: Buffer.from("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n") });
    await page.locator("li.open strong").getByText("corner").waitFor();
    await page.setInputFiles("#file", { name: "edge.obj", mimeType: "model/obj", buffer: Buffer.from("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n") });
    await page.getByText("What is in edge.obj is stored as corner.").waitFor();
    // An ending that says nothing keeps no file from being looked at.
    await page.setInputFiles("#file", { name: "corner.2024", mimeType: "", buffer: Buffer.from("OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n") });
    await page.waitForFunction(() => window.chladni.app.mesh?.faces === 2 && window.chladni.app.mesh.name === "corner");
    await close();
  });
  await page.context().close();
}
