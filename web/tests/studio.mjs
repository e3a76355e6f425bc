// Functional maps in the page: landmarks by pointer and keyboard, the map, its files, its address.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { picture, ROOT } from "./harness.mjs";
import { kit, pictures } from "./kit.mjs";

export async function studio(site) {
  const { test, keep, chooser, opened, violations } = kit(site);
  const page = await site.open();
  const mapped = (before) => page.waitForFunction((before) => document.body.dataset.mapped !== undefined && document.body.dataset.mapped !== before, before, { timeout: 60_000 });
  const turn = () => page.evaluate(() => document.body.dataset.mapped);
  const taken = async (name) => {
    const [file] = await Promise.all([page.waitForEvent("download"), page.locator("#panel-maps").getByRole("button", { name, exact: true }).click()]);
    const path = join(site.folder, file.suggestedFilename());
    await file.saveAs(path);
    return readFileSync(path);
  };
  /** Places in the window on the left surface, far from each other, and those on the right that look the same. */
  const places = (count) => page.evaluate((count) => {
    const { viewer, app } = window.chladni;
    const [left, right] = [viewer.canvas, app.beside.viewer.canvas].map((canvas) => canvas.getBoundingClientRect());
    const hits = [];
    for (let s = 0.05; s < 0.95; s += 0.03) {
      for (let t = 0.15; t < 0.85; t += 0.03) {
        const at = [left.left + s * left.width, left.top + t * left.height];
        // Not at an edge, where a pixel decides.
        if ([[0, 0], [8, 0], [-8, 0], [0, 8], [0, -8]].every(([x, y]) => viewer.pick(at[0] + x, at[1] + y))) hits.push({ at, there: [right.left + s * right.width, right.top + t * right.height] });
      }
    }
    const chosen = [hits[0]];
    const far = ({ at }) => Math.min(...chosen.map((other) => Math.hypot(at[0] - other.at[0], at[1] - other.at[1])));
    while (chosen.length < count) chosen.push(hits.reduce((best, hit) => (far(hit) > far(best) ? hit : best)));
    return chosen;
  }, count);

  await test("two surfaces stand side by side, and their cameras turn as one unless they are told not to", async () => {
    await opened(page, "shape", "starfish", 1200, 60);
    // The same surface, whose file begins with a vertex that belongs to no face.
    await page.evaluate(async () => {
      const { positions: p, triangles: t } = window.chladni.viewer.surface;
      const lines = ["v 9 9 9"];
      for (let v = 0; v < p.length; v += 3) lines.push(`v ${p[v]} ${p[v + 1]} ${p[v + 2]}`);
      for (let f = 0; f < t.length; f += 3) lines.push(`f ${t[f] + 2} ${t[f + 1] + 2} ${t[f + 2] + 2}`);
      await fetch("/v1/meshes?name=shifted&format=obj", { method: "POST", body: lines.join("\n") });
      await window.chladni.app.list();
    });
    await page.getByRole("tab", { name: "Maps" }).click();
    const other = await page.evaluate(() => window.chladni.app.meshes.find(({ name }) => name === "shifted").id);
    await chooser(page, "Other").selectOption(other);
    await page.getByRole("button", { name: /^Compute 120 pairs/ }).click();
    await mapped();
    const widths = await page.evaluate(() => [window.chladni.viewer, window.chladni.app.beside.viewer].map(({ canvas }) => Math.round(canvas.clientWidth)));
    assert.deepEqual(widths, Array(2).fill(await page.evaluate(() => Math.round(document.querySelector(".stage").clientWidth / 2))));
    const views = () => page.evaluate(() => [window.chladni.viewer.view, window.chladni.app.beside.viewer.view]);
    const before = (await views())[0];
    await page.getByRole("application", { name: "The other surface" }).focus();
    await page.keyboard.press("ArrowLeft");
    const [left, right] = await views();
    assert.equal(left, right);
    assert.notEqual(left, before);
    await page.getByLabel("link the cameras").uncheck();
    await page.getByRole("application", { name: "The other surface" }).focus();
    await page.keyboard.press("ArrowLeft");
    const [still, turned] = await views();
    assert.ok(still === left && turned !== right);
    await page.getByLabel("link the cameras").check();
    assert.deepEqual(await views(), [left, left]);
  });

  await test("landmarks by clicks lead each vertex to where it belongs, and the files say so", async () => {
    const before = await turn();
    for (const { at, there } of await places(6)) {
      await page.mouse.click(...at);
      await page.mouse.click(...there);
    }
    assert.equal(await page.locator(".landmarks li").count(), 6);
    await mapped(before);
    await keep(page, "studio");
    const vertices = await page.evaluate(() => window.chladni.app.mesh.vertices);
    // Numbers of the kept meshes are equal on both sides: a right map is the identity.
    const csv = String(await taken("CSV")).trim().split("\n").map((line) => line.split(","));
    assert.deepEqual(csv[0], ["target_kept_vertex", "source_kept_vertex", "confidence"]);
    assert.equal(csv.length, vertices + 1);
    const right = csv.slice(1).filter(([target, source]) => target === source).length;
    assert.ok(right > 0.95 * vertices, `${right} of ${vertices} vertices`);
    const npy = await taken("NPY");
    const begin = 10 + npy.readUInt16LE(8);
    assert.match(String(npy.subarray(10, begin)), /'<i4'/);
    assert.ok(csv.slice(1).every(([, source], v) => npy.readInt32LE(begin + 4 * v) === Number(source)));
    // In the numbers of the files the second has one vertex more, and it belongs nowhere.
    await chooser(page, "Numbering").selectOption("file");
    const named = String(await taken("CSV")).trim().split("\n").map((line) => line.split(","));
    assert.deepEqual([named[0][0], named.length, named[1].join()], ["target_vertex", vertices + 2, "0,,"]);
    assert.ok(named.slice(2).every(([target, source], v) => Number(target) === v + 1 && source === csv[v + 1][1]));
    const ply = await taken("PLY, coloured");
    assert.equal(ply.length - (ply.indexOf("end_header\n") + 11), 19 * vertices + 13 * (await page.evaluate(() => window.chladni.app.mesh.faces)));
  });

  await test("what is shown on one surface is carried to the other", async () => {
    const seen = [];
    for (const shown of ["colours", "checks", "mode", "confidence"]) {
      await chooser(page, "Show").selectOption(shown);
      await page.waitForFunction((shown) => document.body.dataset.carried?.startsWith(shown), shown);
      seen.push((await picture(page)).toString("base64"));
      await keep(page, `studio-${shown}`);
      // The picture of the manual.
      if (pictures && shown === "checks") await page.screenshot({ path: join(ROOT, "docs", "pictures", "studio.png") });
    }
    assert.equal(new Set(seen).size, 4);
    assert.match(await page.locator("#panel-maps .facts-list").innerText(), /Size\s+60 × 60[^]*Coverage\s+(9\d|100) %/);
  });

  await test("the range of the colours is that of both surfaces, and the request that is copied is the map", async () => {
    await chooser(page, "Show").selectOption("mode");
    await page.waitForFunction(() => document.body.dataset.carried === "mode 7");
    const right = () => page.locator(".pane.beside").screenshot();
    await picture(page);
    const before = await right();
    await page.getByLabel("Colours end at").fill("0.2");
    await page.getByLabel("Colours end at").press("Enter");
    await page.waitForFunction(() => document.querySelector(".legend .labels").lastChild.textContent === "0.2");
    await page.waitForFunction(() => {
      const [left, right] = [window.chladni.viewer, window.chladni.app.beside.viewer].map((viewer) => viewer.shading.uniforms.range.value);
      return left.equals(right);
    });
    await picture(page);
    assert.notDeepEqual(await right(), before);
    await page.getByLabel("Colours end at").fill("");
    await page.getByLabel("Colours end at").press("Enter");
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await page.locator("#panel-maps").getByRole("button", { name: "Copy the request as curl" }).click();
    await page.locator(".toast").waitFor();
    assert.match(await page.evaluate(() => navigator.clipboard.readText()), /\/v1\/functional-maps/);
    await page.getByRole("button", { name: "Close" }).first().click();
  });

  await test("an address leads back to both surfaces, the landmarks, and what is shown", async () => {
    await page.waitForFunction(() => location.hash.includes("design="));
    await chooser(page, "Show").selectOption("checks");
    const wanted = await page.locator(".landmarks").innerText();
    await page.waitForFunction(() => JSON.parse(atob(new URLSearchParams(location.hash.slice(1)).get("design").replaceAll("-", "+").replaceAll("_", "/"))).shown === "checks");
    const other = await site.open(`/${await page.evaluate(() => location.hash)}`);
    await other.waitForFunction(() => document.body.dataset.carried === "checks", null, { timeout: 60_000 });
    assert.equal(await other.locator(".landmarks").innerText(), wanted);
    assert.equal(await other.evaluate(() => window.chladni.app.beside.mesh.name), "shifted");
    await other.context().close();
  });

  await test("the keyboard sets landmarks and takes them away", async () => {
    const before = await turn();
    for (const name of ["The surface", "The other surface"]) {
      await page.getByRole("application", { name, exact: true }).focus();
      await page.keyboard.press("Enter");
      await page.keyboard.press("ArrowUp");
      await page.keyboard.press("Enter");
      await page.keyboard.press("Escape");
    }
    await page.waitForFunction(() => document.querySelectorAll(".landmarks li").length === 7);
    await mapped(before);
    await page.getByRole("button", { name: "Remove landmark 3" }).press("Enter");
    await page.waitForFunction(() => document.querySelectorAll(".landmarks li").length === 6);
    // The next one in the list is under the finger.
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "Remove landmark 3");
  });

  await test("another basis of the other surface can be chosen", async () => {
    await page.evaluate(() => window.chladni.app.submit("eigenbasis", { count: 45 }, window.chladni.app.beside.mesh.id));
    await page.waitForFunction(() => window.chladni.app.jobs.list.some((job) => job.parameters.count === 45 && job.status === "succeeded"));
    await page.getByRole("tab", { name: "Modes" }).click();
    await page.getByRole("tab", { name: "Maps" }).click();
    await chooser(page, "Its basis").waitFor();
    const texts = await chooser(page, "Its basis").locator("option").allInnerTexts();
    assert.deepEqual(texts, ["120 · auto", "45 · auto"]);
    const request = page.waitForRequest((request) => request.url().includes("/v1/functional-maps") && request.postDataJSON().pairs === 45);
    await chooser(page, "Its basis").selectOption({ index: 1 });
    assert.equal((await request).postDataJSON().target, await chooser(page, "Its basis").inputValue());
    const before = await turn();
    await chooser(page, "Its basis").selectOption({ index: 0 });
    await mapped(before);
  });

  await test("the surfaces change sides, with their landmarks", async () => {
    const rows = () => page.locator(".landmarks li span:nth-child(2)").allInnerTexts();
    const before = await rows();
    await page.getByRole("button", { name: "Swap sides" }).click();
    await page.waitForFunction(() => window.chladni.app.mesh.name === "shifted" && window.chladni.app.beside.mesh.name === "shape" && document.body.dataset.mapped, null, { timeout: 60_000 });
    assert.deepEqual(await rows(), before.map((row) => row.split(" ↔ ").reverse().join(" ↔ ")));
  });

  await test("the studio breaks no rule of WCAG 2.2 AA, light or dark, and fits a phone", async () => {
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      assert.deepEqual(await violations(page), []);
      await keep(page, `studio-${colorScheme}`);
    }
    await page.emulateMedia({ colorScheme: "light" });
    await page.setViewportSize({ width: 390, height: 844 });
    assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
    await keep(page, "studio-phone");
    await page.setViewportSize({ width: 1100, height: 700 });
    await page.getByRole("tab", { name: "Modes" }).click();
    assert.equal(await page.locator(".pane.beside").isHidden(), true);
  });

  await test("a surface that is deleted leaves the studio, whoever deletes it", async () => {
    const ids = await page.evaluate(() => Object.fromEntries(window.chladni.app.meshes.map(({ name, id }) => [name, id])));
    await page.evaluate((id) => window.chladni.app.open(id), ids.shifted);
    await page.getByRole("tab", { name: "Maps" }).click();
    await chooser(page, "Other").focus();
    await chooser(page, "Other").selectOption(ids.shape);
    await mapped();
    // A choice keeps the focus.
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "Other");
    for (const name of ["The surface", "The other surface"]) {
      await page.getByRole("application", { name, exact: true }).focus();
      for (const key of ["Enter", "Enter", "Escape"]) await page.keyboard.press(key);
    }
    await page.getByRole("button", { name: "Remove landmark 1" }).press("Enter");
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "The surface");
    assert.ok(await page.locator("#panel-maps").getByRole("button", { name: "Clear" }).isDisabled());
    // The open surface is not the other one of itself.
    await page.evaluate((id) => window.chladni.app.open(id), ids.shape);
    assert.deepEqual([await chooser(page, "Other").inputValue(), await page.locator(".pane.beside").isHidden()], ["", true]);
    await page.evaluate(() => window.chladni.app.remove());
    assert.equal(await page.evaluate(() => window.chladni.app.beside.mesh), null);
    await opened(page, "again", "starfish", 1200, 60);
    await page.evaluate((id) => window.chladni.app.open(id), ids.shifted);
    await chooser(page, "Other").selectOption(await page.evaluate(() => window.chladni.app.meshes.find(({ name }) => name === "again").id));
    await mapped();
    await page.evaluate(() => fetch(`/v1/meshes/${window.chladni.app.beside.mesh.id}?cascade=true`, { method: "DELETE" }));
    await page.getByLabel("also match heat kernels").uncheck();
    await page.locator(".pane.beside").waitFor({ state: "hidden" });
    await page.waitForFunction(() => !window.chladni.app.meshes.some(({ name }) => name === "again"));
    assert.equal(await page.evaluate(() => window.chladni.app.beside.mesh), null);
    while (await page.locator(".toast").count()) await page.getByRole("button", { name: "Close" }).first().click();
  });
  await page.context().close();
}
