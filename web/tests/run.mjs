// The page in a real browser against a real server: `npm test`, after `cargo build --release`.
//
//   npm test                the tests
//   npm test -- --pictures  also keeps pictures in tests/pictures, and the one of the README in docs/pictures
//   npm test -- --only=studio  the tests of one file beside this one

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fields } from "./fields.mjs";
import { browserPath, drawn, pageIsThere, picture, ROOT, sample, start } from "./harness.mjs";
import { counts, kit, pictures } from "./kit.mjs";
import { looks } from "./looks.mjs";
import { meanwhile } from "./meanwhile.mjs";
import { queue } from "./queue.mjs";
import { studio } from "./studio.mjs";
import { widget } from "./widget.mjs";

if (!browserPath()) {
  console.log("skipped: no Chromium is installed (Debian: apt-get install chromium)");
  process.exit(0);
}
const site = await start();
const { test, keep, saved, changed, datum, onSurface, upload, compute, violations } = kit(site);
/** Tests of one subject, each in a file of its own; `--only=NAME` runs them alone. */
const SUBJECTS = { looks, fields, studio, queue, meanwhile, widget };
const only = process.argv.find((argument) => argument.startsWith("--only="))?.slice(7);

try {
  if (!process.env.CHLADNI_DIST && !(await pageIsThere(site.url))) {
    console.log("skipped: this binary was built without its web page");
    await site.stop();
    process.exit(0);
  }
  if (!only) await everything();
  for (const [name, subject] of Object.entries(SUBJECTS)) if (!only || only === name) await subject(site);
} finally {
  await site.stop();
}
console.log(`${counts.passed} tests of the page passed, ${counts.failed} failed`);
process.exit(counts.failed ? 1 : 0);

async function everything() {
  const knot = sample(site.folder, "knot", 3000);
  const page = await site.open();

  await test("an empty page offers surfaces, and one click leads to a swinging mode", async () => {
    // What each tab is for can be read before there is anything to work on.
    await page.getByRole("tab", { name: "Vibration" }).click();
    await page.locator("#panel-vibration .about").getByText("thin shell").waitFor();
    await page.getByRole("tab", { name: "Modes" }).click();
    await keep(page, "welcome");
    await page.locator(".welcome").getByRole("button", { name: "bell" }).click();
    await page.waitForFunction(() => document.body.dataset.mode === "12" && window.chladni.viewer.moving);
    assert.equal(await page.getByRole("button", { name: "Animate" }).getAttribute("aria-pressed"), "true");
    assert.ok(await page.locator(".welcome").isHidden());
    await page.getByRole("button", { name: "Animate" }).click();
    await keep(page, "bell");
  });

  await test("what stands on z stands upright, and another axis can be chosen and kept", async () => {
    const axis = page.getByLabel("Up axis", { exact: true });
    assert.equal(await axis.inputValue(), "z");
    const upright = await picture(page);
    await axis.selectOption("-x");
    assert.notDeepEqual(await picture(page), upright);
    const address = await page.evaluate(() => location.hash);
    assert.match(address, /up=-x/);
    const other = await site.open(`/${address}`);
    await other.waitForFunction(() => document.body.dataset.mode === "12");
    assert.deepEqual(await other.evaluate(() => [window.chladni.viewer.up, document.querySelector(".stagebar select").value]), ["-x", "-x"]);
    await other.context().close();
    await axis.selectOption("z");
    assert.doesNotMatch(await page.evaluate(() => location.hash), /up=/);
  });

  await test("what is shown can be taken away as files that others read", async () => {
    const [vertices, faces] = await page.evaluate(() => [window.chladni.app.mesh.vertices, window.chladni.app.mesh.faces]);
    const taken = (name) => saved(page, name);
    const png = await taken("PNG");
    assert.deepEqual([png.readUInt32BE(16), png.readUInt32BE(20)], await page.evaluate(() => [2 * window.chladni.viewer.canvas.clientWidth, 2 * window.chladni.viewer.canvas.clientHeight]));
    const obj = String(await taken("OBJ")).split("\n");
    assert.deepEqual([obj.filter((line) => line.startsWith("v ")).length, obj.filter((line) => line.startsWith("f ")).length], [vertices, faces]);
    const ply = await taken("PLY with colours");
    assert.equal(ply.length - (ply.indexOf("end_header\n") + 11), 19 * vertices + 13 * faces);
    const glb = await taken("GLB");
    assert.deepEqual([glb.subarray(0, 4).toString(), glb.readUInt32LE(8)], ["glTF", glb.length]);
    const shape = JSON.parse(glb.subarray(20, 20 + glb.readUInt32LE(12)));
    assert.deepEqual(shape.accessors.map(({ count }) => count).sort((a, b) => a - b), [vertices, vertices, vertices, 3 * faces]);
    // The bell stands on z; viewers of glTF look along y.
    const { min, max } = shape.accessors[shape.meshes[0].primitives[0].attributes.POSITION];
    assert.ok(Math.abs(min[1]) < 1e-6 && Math.abs(max[1] - 1.35) < 1e-2 && Math.abs(max[2] - 1) < 1e-2, `${min} ${max}`);
    assert.match(String(await taken("VTP (ParaView)")), new RegExp(`NumberOfPoints="${vertices}".*NumberOfPolys="${faces}"`));
    const rows = String(await taken("CSV")).trim().split("\n");
    const npy = await taken("NPY (NumPy)");
    const begin = 10 + npy.readUInt16LE(8);
    assert.deepEqual([rows.length, npy.length - begin, begin % 64], [vertices + 1, 4 * vertices, 0]);
    assert.ok(rows.slice(1, 50).every((row, v) => Math.fround(Number(row.split(",")[4])) === npy.readFloatLE(begin + 4 * v)));
    assert.equal((await taken("Film of a turn, 6 s")).readUInt32BE(0), 0x1a45dfa3);
    while (await page.locator(".toast").count()) await page.getByRole("button", { name: "Close" }).first().click();
  });

  await test("a copied request does by hand what the page did", async () => {
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    const copied = async (name) => {
      await page.locator(".panel:not([hidden])").getByRole("button", { name, exact: true }).click();
      await page.locator(".toast").getByText("is on the clipboard").first().waitFor();
      const text = await page.evaluate(() => navigator.clipboard.readText());
      while (await page.locator(".toast").count()) await page.getByRole("button", { name: "Close" }).first().click();
      return text;
    };
    const vertices = await page.evaluate(() => window.chladni.app.mesh.vertices);
    execFileSync("sh", ["-c", await copied("Copy the request as curl")], { cwd: site.folder });
    assert.equal(readFileSync(join(site.folder, "answer.bin")).length, 4 * vertices);
    // The other form, as far as it goes without NumPy.
    assert.match(await copied("Copy the request as Python"), /^import json, urllib\.request\nimport numpy as np\n[^]*"Accept": "application\/octet-stream"[^]*np\.frombuffer/);
    const known = await page.evaluate(() => window.chladni.app.basis.id);
    const answer = execFileSync(process.env.CHLADNI_PYTHON ?? "python3", ["-c", `${await copied("Copy the job as Python")}print(result["basis"])`]);
    assert.equal(String(answer).trim(), known);
    // So does the form of another job, before it is sent.
    await page.locator(".panel:not([hidden]) .new > summary").first().click();
    assert.match(await copied("Copy the new job as curl"), /^curl -sS '[^']*\/v1\/jobs\?numbering=kept' [^]*"kind":"eigenbasis","mesh":"[0-9a-f]+","parameters":\{"count":200,/);
    await page.locator(".panel:not([hidden]) .new > summary").first().click();
  });

  await test("edges come and go, and the surface goes on changing after them", async () => {
    const edges = page.getByRole("button", { name: "Edges" });
    const plain = await picture(page);
    await edges.click();
    assert.notDeepEqual(await picture(page), plain);
    await edges.click();
    const seen = () => page.evaluate(async () => (await window.chladni.viewer.snapshot()).arrayBuffer().then((bytes) => [...new Uint8Array(bytes)].join()));
    const without = await seen();
    await page.getByRole("button", { name: "Next mode" }).click();
    await page.waitForFunction(() => document.body.dataset.mode === "13");
    assert.notEqual(await seen(), without);
  });

  await test("a surface is renamed, found by its name, and deleted only when asked twice", async () => {
    const open = page.locator("li.open");
    await open.getByRole("button", { name: "Rename" }).click();
    await open.getByLabel("New name").fill("church bell");
    await page.keyboard.press("Enter");
    await open.locator("strong").getByText("church bell").waitFor();
    await open.getByRole("button", { name: "Delete" }).click();
    await open.getByRole("button", { name: "Keep" }).click();
    await open.getByRole("button", { name: "Delete" }).click();
    await open.getByRole("button", { name: "Delete with 1 basis" }).click();
    await page.locator(".welcome").waitFor();
    assert.equal(await page.locator("ul.meshes > li").count(), 0);
    await page.getByRole("button", { name: "Close" }).click();
  });

  await test("a mesh is uploaded, solved and shown as an eigenfunction", async () => {
    await upload(page, knot);
    assert.match(await page.locator("li.open .report").innerText(), /genus 1.*closed/s);
    const plain = await picture(page);
    const takes = page.locator(".panel:not([hidden]) .expected");
    await takes.getByText(/^Takes about [\d.]+ s of one core, up to [\d.]+ MB\.$/).waitFor();
    await page.locator(".panel:not([hidden])").getByLabel("Eigenpairs", { exact: true }).fill("4000");
    await takes.getByText(/2996|2,996/).waitFor();
    await compute(page, { Eigenpairs: "40" });
    await changed(page, "mode");
    assert.equal(await datum(page, "mode"), "1");
    assert.notDeepEqual(await picture(page), plain);
    const slider = page.getByRole("slider", { name: "Mode" });
    await slider.fill("12");
    await page.waitForFunction(() => document.body.dataset.mode === "12");
    assert.match(await page.locator("#panel-modes .facts").innerText(), /λ = .+±.+residual/s);
    assert.match(await page.locator(".certificate").innerText(), /40 eigenpairs of the cotangent Laplacian/);
    await slider.press("ArrowRight");
    await page.waitForFunction(() => document.body.dataset.mode === "13");
    await keep(page, "modes");
  });

  await test("an address leads back to the same mesh, basis, mode and camera", async () => {
    const canvas = page.locator("canvas.surface");
    await canvas.focus();
    const before = await page.evaluate(() => window.chladni.viewer.view);
    await canvas.press("ArrowLeft");
    await canvas.press("+");
    const view = await page.evaluate(() => window.chladni.viewer.view);
    assert.notEqual(view, before);
    await page.waitForFunction((view) => decodeURIComponent(location.hash).includes(view), view);
    const address = await page.evaluate(() => location.hash);
    const other = await site.open(`/${address}`);
    await other.waitForFunction(() => document.body.dataset.mode === "13");
    assert.equal(await other.evaluate(() => window.chladni.viewer.view), view);
    assert.equal(await other.evaluate(() => window.chladni.app.mesh.id), await page.evaluate(() => window.chladni.app.mesh.id));
    assert.equal(await other.evaluate(() => window.chladni.app.basis.id), await page.evaluate(() => window.chladni.app.basis.id));
    await other.context().close();
  });

  await test("a curve drawn by hand filters the surface", async () => {
    await page.getByRole("tab", { name: "Filter" }).click();
    const plot = page.locator("canvas.drawing");
    const box = await plot.boundingBox();
    const before = await picture(page);
    await page.mouse.move(box.x + 90, box.y + 130);
    await page.mouse.down();
    await page.mouse.move(box.x + 140, box.y + 60, { steps: 3 });
    await page.mouse.move(box.x + 240, box.y + 150, { steps: 3 });
    await page.mouse.up();
    await changed(page, "filtered");
    assert.notDeepEqual(await picture(page), before);
    await keep(page, "filter");
    const moved = await page.evaluate(() => window.chladni.viewer.surface.positions.slice(0, 300).join());
    await page.getByRole("button", { name: "Original" }).click();
    await page.waitForFunction((moved) => window.chladni.viewer.surface.positions.slice(0, 300).join() !== moved, moved);
    await page.getByRole("tab", { name: "Modes" }).click();
    await changed(page, "mode");
  });

  await test("a clicked point tells distances and what is like it", async () => {
    await page.getByRole("tab", { name: "Distances" }).click();
    await changed(page, "field");
    const before = await datum(page, "field");
    const [x, y] = await onSurface(page);
    await page.mouse.click(x, y);
    await changed(page, "field", before);
    assert.match(await datum(page, "field"), /^geodesic \d+$/);
    const shown = await picture(page);
    await page.locator(".panel:not([hidden])").getByLabel("Show", { exact: true }).selectOption("heat_kernel");
    await page.waitForFunction(() => document.body.dataset.field?.startsWith("heat_kernel"));
    assert.notDeepEqual(await picture(page), shown);
    await page.locator(".panel:not([hidden])").getByLabel("Show", { exact: true }).selectOption("similar");
    await page.waitForFunction(() => document.body.dataset.field?.startsWith("similar"));
    await keep(page, "points");
    // By keyboard: the cursor goes to another vertex, and Enter makes that the source.
    const chosen = await datum(page, "field");
    await page.getByRole("application", { name: "The surface" }).focus();
    await page.keyboard.press("Enter");
    for (let step = 0; step < 3; step++) await page.keyboard.press("ArrowDown");
    await page.keyboard.press("Enter");
    await changed(page, "field", chosen);
    assert.equal(await datum(page, "field"), `similar ${await page.evaluate(() => window.chladni.viewer.cursor.hit.vertex)}`);
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("a stroke on the surface combs a field, which becomes streamlines and fur", async () => {
    await page.getByRole("tab", { name: "Fields" }).click();
    await compute(page, { Dimension: "120" });
    await changed(page, "designed");
    const [before, shown] = [await datum(page, "designed"), await picture(page)];
    const [x, y] = await onSurface(page);
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 15, y + 25, { steps: 3 });
    await page.mouse.move(x + 20, y + 55, { steps: 3 });
    await page.mouse.up();
    await changed(page, "designed", before);
    await changed(page, "singular");
    // Poincaré and Hopf: the indices of a field on a torus cancel.
    assert.match(await page.locator(".panel:not([hidden])").innerText(), /indices sum to 0 \(Euler characteristic 0\)/);
    assert.notDeepEqual(await picture(page), shown);
    const show = page.locator(".panel:not([hidden])").getByLabel("Show", { exact: true });
    await keep(page, "fields");
    await show.selectOption("hatching");
    await page.waitForFunction(() => document.body.dataset.traced === "hatching");
    await keep(page, "streamlines");
    const drawing = String(await saved(page, "Lines as SVG"));
    const [, width, height] = /viewBox="0 0 (\d+) (\d+)"/.exec(drawing);
    const points = [...drawing.matchAll(/[ML]([\d.]+) ([\d.]+)/g)].map(([, x, y]) => [Number(x), Number(y)]);
    assert.ok(points.length > 1000 && points.every(([x, y]) => x <= width && y <= height), `${points.length} points`);
    // Half of the lines are on the far side.
    const all = await page.evaluate(() => window.chladni.app.kept.lines.reduce((sum, line) => sum + line.length, 0));
    assert.ok(points.length < 0.75 * all, `${points.length} of ${all} points are seen`);
    await show.selectOption("fur");
    await page.waitForFunction(() => document.body.dataset.traced === "fur");
    await keep(page, "fur");
    // The same by keyboard: a cursor on the surface, Enter, a way, Enter.
    await show.selectOption("glyphs");
    await page.locator(".panel:not([hidden])").getByRole("button", { name: "Clear" }).click();
    await page.waitForFunction(() => document.body.dataset.designed !== undefined);
    const canvas = page.getByRole("application", { name: "The surface" });
    await canvas.focus();
    await page.keyboard.press("Enter");
    const [start, unstroked] = [await page.evaluate(() => window.chladni.viewer.cursor.hit.point), await datum(page, "designed")];
    await page.keyboard.press("Enter");
    for (let step = 0; step < 4; step++) await page.keyboard.press("ArrowRight");
    await page.keyboard.press("Enter");
    await changed(page, "designed", unstroked);
    const [end, pressed] = await page.evaluate(() => [window.chladni.viewer.cursor.hit.point, window.chladni.viewer.cursor.pressed]);
    assert.ok(Math.hypot(...end.map((x, i) => x - start[i])) > 0.1 && !pressed);
    await page.locator(".panel:not([hidden])").getByText(/Energy [1-9.]/).waitFor();
    await keep(page, "keyboard");
    await page.keyboard.press("Escape");
    assert.equal(await page.evaluate(() => window.chladni.viewer.cursor.hit), null);
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("tensors of curvature become as smooth as their weights say", async () => {
    await page.getByRole("tab", { name: "Fields" }).click();
    await page.locator(".panel:not([hidden]) summary").click();
    await compute(page, { Field: "tensor", Dimension: "120" });
    await page.waitForFunction(() => window.chladni.app.basis?.parameters.field === "tensor" && document.body.dataset.designed !== undefined);
    const [before, shown] = [await datum(page, "designed"), await picture(page)];
    await keep(page, "tensors");
    await page.getByRole("slider", { name: "Smoothness" }).fill("1");
    await changed(page, "designed", before);
    assert.notDeepEqual(await picture(page), shown);
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("a family of operators is solved again as its parameter moves", async () => {
    await page.getByRole("tab", { name: "Vibration" }).click();
    await page.locator("#panel-vibration .expected").getByText(/^Takes .*up to [\d.]+ MB\.$/).waitFor();
    await page.getByRole("tab", { name: "Family" }).click();
    await page.locator("#panel-family .expected").getByText(/^Takes .*up to [\d.]+ MB\.$/).waitFor();
    await compute(page, { Dimension: "150" });
    await changed(page, "family");
    const shown = await picture(page);
    await page.getByRole("slider", { name: "Extrinsic t" }).fill("0.8");
    await page.waitForFunction(() => document.body.dataset.family?.startsWith("0.8 "));
    assert.notDeepEqual(await picture(page), shown);
    assert.match(await page.locator(".panel:not([hidden]) .facts").innerText(), /λ = /);
    await keep(page, "family");
  });

  await test("a tapped surface moves and sounds", async () => {
    await page.getByRole("tab", { name: "Vibration" }).click();
    await compute(page, { Modes: "20" });
    await page.locator(".panel:not([hidden])").getByText(/modes? from .* Hz; 6 rigid/).waitFor();
    const [x, y] = await onSurface(page);
    const sizes = [];
    page.on("response", (response) => new URL(response.url()).pathname.endsWith("/simulate") && response.headers()["content-type"] === "application/octet-stream" && sizes.push(Number(response.headers()["content-length"])));
    await page.mouse.click(x, y);
    await page.waitForFunction(() => Number(document.body.dataset.vibrating) > 3);
    // Each frame asks for the displacement that it shows: three single-precision numbers for each vertex.
    const vertices = await page.evaluate(() => window.chladni.app.mesh.vertices);
    assert.ok(sizes.length > 3 && sizes.every((size) => size === 12 * vertices), `${sizes} for ${vertices} vertices`);
    await changed(page, "heard");
    assert.ok(Number(await datum(page, "heard")) > 100_000, "two seconds of sound");
    assert.equal((await saved(page, "WAV")).length, Number(await datum(page, "heard")));
    const moved = await page.evaluate(() => {
      const { viewer } = window.chladni;
      return viewer.surface.positions.reduce((most, x, i) => Math.max(most, Math.abs(x - viewer.resting[i])), 0) / viewer.radius;
    });
    assert.ok(moved > 0 && moved < 0.2, `${moved}`);
    await keep(page, "vibration");
  });

  await test("what is held stays where it is, and the keyboard taps", async () => {
    await page.locator(".panel:not([hidden]) summary").click();
    const form = page.locator(".panel:not([hidden]) form");
    await form.getByLabel("Clamped", { exact: true }).selectOption("brush");
    const [x, y] = await onSurface(page);
    await page.mouse.click(x, y);
    const painted = Number(/^([\d,]+) vert/.exec(await form.getByText(/vertices clamped/).innerText())[1].replace(",", ""));
    assert.ok(painted > 3 && painted < 1500, `${painted}`);
    await keep(page, "clamping");
    await form.getByLabel("Clamped", { exact: true }).selectOption("left");
    const held = await form.getByText(/vertices clamped/).innerText();
    await compute(page, { Modes: "12" });
    await page.locator(".panel:not([hidden])").getByText(/12 modes from .* Hz; 0 rigid; clamped at/).waitFor();
    assert.match(held, /^\d+ vertices clamped\.$/);
    await page.getByRole("application", { name: "The surface" }).focus();
    await page.keyboard.press("Enter");
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("Enter");
    await page.waitForFunction(() => Number(document.body.dataset.vibrating) > 3);
    const [still, most] = await page.evaluate(() => {
      const { viewer, app } = window.chladni;
      const moved = Array.from(viewer.resting, (x, i) => Math.abs(x - viewer.surface.positions[i]));
      const across = viewer.resting.filter((_, i) => i % 3 === 0);
      const [low, high] = across.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);
      const held = moved.filter((_, i) => across[Math.floor(i / 3)] <= low + 0.05 * (high - low));
      return [held.reduce((a, b) => Math.max(a, b)), moved.reduce((a, b) => Math.max(a, b))];
    });
    assert.ok(still === 0 && most > 0, `${still} ${most}`);
    await keep(page, "held");
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("a dropped file with defects is reported as the server found it", async () => {
    const text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 5 5 5\nf 1 2 3\nf 1 3 4\nf 1 2 3\n";
    const data = await page.evaluateHandle((text) => {
      const data = new DataTransfer();
      data.items.add(new File([text], "corner.obj"));
      return data;
    }, text);
    for (const type of ["dragenter", "dragover", "drop"]) await page.dispatchEvent("body", type, { dataTransfer: data });
    await page.waitForFunction(() => window.chladni.app.mesh?.name === "corner");
    await page.locator("li.open .defects").first().click();
    const report = await page.locator("li.open .report").innerText();
    assert.match(report, /duplicate face/);
    assert.match(report, /unreferenced vertex/);
  });

  await test("errors are told in the words of the server", async () => {
    await page.getByRole("tab", { name: "Modes" }).click();
    await page.setInputFiles("#file", { name: "bad.obj", mimeType: "model/obj", buffer: Buffer.from("v 0 0 0\nv 1 0 0\nf 1 2 9\n") });
    await page.getByRole("alert").getByText("Face 0 at line 3 refers to vertex 9 of 2.").waitFor();
    assert.match(await page.getByRole("alert").getByRole("link").getAttribute("href"), /^\/problems\/unreadable-mesh\//);
    await compute(page, { Eigenpairs: "1000" });
    await page.getByRole("alert").getByText(/1000|1,000/).waitFor();
    await keep(page, "error");
    while (await page.locator(".toast").count()) await page.getByRole("button", { name: "Close" }).first().click();
  });

  await test("a reload in the middle of a job finds it again, and it can be cancelled", async () => {
    await page.getByRole("tab", { name: "Modes" }).click();
    await upload(page, sample(site.folder, "sphere", 60_000));
    await compute(page, { Eigenpairs: "400", Method: "hsim", Tolerance: "1e-9" });
    const card = page.locator(".job.processing");
    await card.waitFor();
    const id = await card.getAttribute("data-job");
    await page.reload();
    const again = page.locator(`[data-job="${id}"]`);
    await again.waitFor();
    await page.waitForFunction((id) => document.querySelector(`[data-job="${id}"] progress`), id);
    await keep(page, "job");
    await again.getByRole("button", { name: "Cancel" }).click();
    await page.locator(`.job.canceled[data-job="${id}"]`).waitFor();
  });

  await test("shapes are compared, and a click opens one", async () => {
    for (const shape of ["torus", "disk"]) {
      await upload(page, sample(site.folder, shape, 1500));
      await page.getByRole("tab", { name: "Modes" }).click();
      await compute(page, { Eigenpairs: "40" });
      await changed(page, "mode");
    }
    await page.getByRole("tab", { name: "Shapes" }).click();
    await page.waitForFunction(() => document.body.dataset.shapes === "3");
    await keep(page, "shapes");
    await page.locator(".near button", { hasText: /^knot/ }).click();
    await page.waitForFunction(() => window.chladni.app.mesh.name.startsWith("knot"));
    // The dots themselves: one in the colour of all shapes but the open one.
    await page.waitForFunction(() => document.body.dataset.shapes === "3");
    const [x, y] = await page.evaluate(() => {
      const plot = document.querySelector(".panel:not([hidden]) canvas.plot");
      const { width, height } = plot;
      const { data } = plot.getContext("2d").getImageData(0, 0, width, height);
      for (let i = 0; i < width * height; i++) {
        if (data[4 * i] !== 0x1d || data[4 * i + 1] !== 0x5f || data[4 * i + 2] !== 0xa8 || data[4 * i + 3] !== 255) continue;
        const box = plot.getBoundingClientRect();
        return [box.left + (i % width), box.top + Math.floor(i / width) + 3];
      }
      throw new Error("no dot in the plot");
    });
    await page.mouse.click(x, y);
    await page.waitForFunction(() => /^(torus|disk)/.test(window.chladni.app.mesh.name));
  });

  await test("the keyboard reaches everything, and shows and says where it is", async () => {
    await page.evaluate(() => document.activeElement?.blur());
    await page.getByRole("tab", { name: "Modes" }).click();
    await changed(page, "mode");
    await page.evaluate(() => window.scrollTo(0, 0));
    await page.locator("header a").first().focus();
    const stops = [];
    for (let step = 0; step < 60; step++) {
      await page.keyboard.press("Tab");
      const stop = await page.evaluate(() => {
        const element = document.activeElement;
        if (!element || element === document.body) return null;
        const style = getComputedStyle(element);
        const shown = (style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0) || (element.id === "file" && getComputedStyle(element.parentElement).borderColor);
        const label = element.labels?.[0]?.textContent ?? "";
        return { what: element.tagName.toLowerCase(), name: (element.getAttribute("aria-label") || element.textContent || label).trim(), shown: Boolean(shown) };
      });
      if (!stop) break;
      stops.push(stop);
    }
    assert.deepEqual(stops.filter(({ name, shown }) => !name || !shown), []);
    const names = stops.map(({ name }) => name);
    for (const wanted of [/^The surface$/, /^Modes$/, /^Mode$/, /^Animate$/, /^Colours$/, /^Isolines$/, /^Download as NPZ/, /knot/]) {
      assert.ok(names.some((name) => wanted.test(name)), `${wanted} among ${names.join(", ")}`);
    }
    // Arrows go through the tabs.
    await page.getByRole("tab", { name: "Modes" }).focus();
    await page.keyboard.press("ArrowRight");
    assert.equal(await page.evaluate(() => [document.activeElement.textContent, window.chladni.app.panel.id].join()), "Filter,filter");
  });

  await test("the names of many surfaces are searched and sorted", async () => {
    for (const [name, size] of [["first", 400], ["second", 900]]) await page.evaluate(async ([name, size]) => {
      const file = await (await fetch(`/v1/samples/torus?vertices=${size}`)).blob();
      await fetch(`/v1/meshes?name=${name}`, { method: "POST", body: file });
    }, [name, size]);
    await page.evaluate(() => window.chladni.app.list());
    const names = () => page.locator("ul.meshes > li > button strong").allInnerTexts();
    const all = await names();
    await page.getByLabel("Order of the surfaces").selectOption("name");
    assert.deepEqual(await names(), all.slice().sort((a, b) => a.localeCompare(b, undefined, { numeric: true })));
    await page.getByLabel("Search by name").fill("SECO");
    await page.waitForFunction(() => document.querySelectorAll("ul.meshes > li").length === 1);
    assert.deepEqual(await names(), ["second"]);
    await page.getByLabel("Search by name").fill("");
    await page.waitForFunction((count) => document.querySelectorAll("ul.meshes > li").length === count, all.length);
  });

  await test("no rule of WCAG 2.2 AA that a machine can check is broken, in any tab, light or dark", async () => {
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      for (const tab of ["Modes", "Filter", "Distances", "Fields", "Family", "Vibration", "Shapes", "Maps"]) {
        await page.getByRole("tab", { name: tab }).click();
        await page.locator(".panel:not([hidden])").waitFor();
        // What is folded away counts too.
        await page.evaluate(() => document.querySelectorAll(".panel:not([hidden]) details").forEach((details) => (details.open = true)));
        if (tab === "Modes") await page.locator(".save summary").click();
        assert.deepEqual((await violations(page)).map((text) => `${colorScheme} ${tab} ${text}`), []);
        if (tab === "Modes") await page.keyboard.press("Escape");
      }
    }
    await page.emulateMedia({ colorScheme: "light" });
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("everything fits a phone, and dark is dark", async () => {
    const address = await page.evaluate(() => {
      const { app } = window.chladni;
      return `/#mesh=${app.meshes.find((mesh) => mesh.name?.startsWith("knot")).id}&mode=9`;
    });
    const phone = await site.open(address, { viewport: { width: 390, height: 844 }, colorScheme: "dark", hasTouch: true, isMobile: true });
    await phone.waitForFunction(() => document.body.dataset.mode === "9");
    assert.ok((await phone.evaluate(() => document.documentElement.scrollWidth)) <= 390);
    const back = await phone.evaluate(() => getComputedStyle(document.body).backgroundColor);
    assert.ok(Math.max(...back.match(/\d+/g).map(Number)) < 60, back);
    await keep(phone, "phone");
    await phone.context().close();
  });
  await page.context().close();

  await test("where keys are asked for, everything carries the key, downloads too", async () => {
    const secret = "5ecret-0f-this-test-0123456789";
    const locked = await start(`me:read+submit:${secret}`);
    try {
      const visitor = await locked.open();
      await visitor.getByRole("alert").getByText(/key/i).first().waitFor();
      await visitor.getByLabel("API key").fill("\u200bsecret");
      await visitor.getByRole("button", { name: "Use" }).click();
      await visitor.getByRole("alert").getByText("This cannot be an API key").waitFor();
      await visitor.getByLabel("API key").fill(secret);
      await visitor.getByRole("button", { name: "Use" }).click();
      await upload(visitor, knot);
      await compute(visitor, { Eigenpairs: "30" });
      await changed(visitor, "mode");
      // What is copied names the key, and does not hold it; without a clipboard the text stands there to be taken.
      await visitor.evaluate(() => Object.defineProperty(navigator, "clipboard", { value: undefined }));
      await visitor.locator(".panel:not([hidden])").getByRole("button", { name: "Copy the job as curl" }).click();
      const text = await visitor.locator("textarea.by-hand").inputValue();
      assert.ok(text.includes("$CHLADNI_KEY") && !text.includes(secret), text);
      for (const [name, begin] of [[/Download as NPZ/, "PK"], ["metadata", "{"]]) {
        const [file] = await Promise.all([visitor.waitForEvent("download"), visitor.getByRole("link", { name }).click()]);
        const path = join(locked.folder, "download");
        await file.saveAs(path);
        const bytes = readFileSync(path);
        assert.match(file.suggestedFilename(), /^knot-3000-30-/);
        assert.equal(bytes.subarray(0, begin.length).toString(), begin);
      }
      assert.deepEqual(locked.complaints, []);
    } finally {
      await locked.stop();
    }
  });

  if (pictures) {
    const fresh = await start();
    const readme = await fresh.open("/", { viewport: { width: 1040, height: 640 } });
    await upload(readme, sample(fresh.folder, "knot", 20_000));
    await compute(readme, { Eigenpairs: "200" });
    await changed(readme, "mode");
    await readme.getByRole("slider", { name: "Mode" }).fill("37");
    await readme.waitForFunction(() => document.body.dataset.mode === "37");
    await drawn(readme);
    const page = await readme.screenshot();
    mkdirSync(join(ROOT, "docs", "pictures"), { recursive: true });
    writeFileSync(join(ROOT, "docs", "pictures", "page.png"), page);
    await fresh.stop();
    assert.ok(page.length < 300_000, `the picture of the README has ${page.length} bytes`);
  }
}
