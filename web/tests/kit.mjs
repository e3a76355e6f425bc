// What the tests of the page share: how one is run, and what they do over and over.

import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { drawn, ROOT } from "./harness.mjs";

export const pictures = process.argv.includes("--pictures");
const shots = join(ROOT, "web", "tests", "pictures");
if (pictures) mkdirSync(shots, { recursive: true });

/** Pictures that the manual shows. */
const MANUAL = { singularities: "fields.png", comparison: "comparing-bases.png" };

/** How many tests passed and failed. */
export const counts = { passed: 0, failed: 0 };

/** Tests and steps against a server. */
export function kit(site) {
  /** Runs one test; what the browser complained about fails it too. */
  async function test(name, body) {
    const begin = performance.now();
    site.complaints.length = 0;
    try {
      await body();
      assert.deepEqual(site.complaints, [], "the browser complained");
      counts.passed += 1;
      console.log(`ok      ${name} (${((performance.now() - begin) / 1000).toFixed(1)} s)`);
    } catch (error) {
      counts.failed += 1;
      console.log(`FAILED  ${name}\n        ${String(error.stack ?? error).replaceAll("\n", "\n        ")}`);
      if (site.complaints.length) console.log(`        ${site.complaints.join("\n        ")}`);
    }
  }

  const keep = async (page, name) => {
    if (!pictures) return;
    await drawn(page);
    const picture = await page.screenshot({ path: join(shots, `${name}.png`) });
    if (MANUAL[name]) writeFileSync(join(ROOT, "docs", "pictures", MANUAL[name]), picture);
  };
  /** What the menu saves under this name. */
  const saved = async (page, name) => {
    await page.locator(".save summary").click();
    const [file] = await Promise.all([page.waitForEvent("download"), page.locator(".menu").getByRole("button", { name, exact: true }).click()]);
    const path = join(site.folder, file.suggestedFilename());
    await file.saveAs(path);
    return readFileSync(path);
  };
  const changed = (page, name, before) => page.waitForFunction(([name, before]) => document.body.dataset[name] !== undefined && document.body.dataset[name] !== before, [name, before]);
  const datum = (page, name) => page.evaluate((name) => document.body.dataset[name], name);
  /** A place in the window under which the surface lies: on a line through the middle. */
  const onSurface = (page, from = 0.3) => page.evaluate((from) => {
    const { viewer } = window.chladni;
    const box = viewer.canvas.getBoundingClientRect();
    for (let t = from; t < 1; t += 0.01) {
      const at = [box.left + t * box.width, box.top + 0.5 * box.height];
      if (viewer.pick(...at)) return at;
    }
    throw new Error("the surface is nowhere");
  }, from);
  const upload = async (page, file) => {
    await page.setInputFiles("#file", file);
    await page.waitForFunction((name) => window.chladni.app.mesh?.name === name && document.querySelector("li.open"), basename(file, ".ply"));
    await page.locator(".panel:not([hidden]) form").waitFor();
  };
  const compute = async (page, fields = {}) => {
    const form = page.locator(".panel:not([hidden]) form");
    for (const [label, value] of Object.entries(fields)) {
      const control = form.getByLabel(label, { exact: true });
      if (await control.evaluate((element) => element.tagName === "SELECT")) await control.selectOption(value);
      else await control.fill(value);
    }
    await form.getByRole("button", { name: "Compute" }).click();
  };
  /** What the page shows of WCAG 2.2 AA that is broken, as far as a machine can tell. */
  const violations = async (page) => {
    await page.evaluate(AXE);
    const found = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }));
    return found.violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target, failureSummary }) => `${target} ${failureSummary}`).join("; ")}`);
  };
  /** The combo box with this label in the open tab. */
  const chooser = (page, name) => page.locator(".panel:not([hidden])").getByRole("combobox", { name, exact: true });
  /** The field of a form of a folded "New …". */
  const unfold = async (page) => {
    const details = page.locator(".panel:not([hidden]) .head details.new");
    if (!(await details.evaluate(({ open }) => open))) await details.locator("summary").click();
  };
  /** Loads a generated mesh through the API, opens it, and computes an eigenbasis where one is wanted. */
  const opened = async (page, name, shape, vertices, pairs = 0) => {
    await page.evaluate(async ([name, shape, vertices, pairs]) => {
      const { app } = window.chladni;
      const file = await (await fetch(`/v1/samples/${shape}?vertices=${vertices}`)).blob();
      const mesh = await (await fetch(`/v1/meshes?name=${name}`, { method: "POST", body: file })).json();
      await app.list();
      await app.open(mesh.id);
      if (pairs) await app.submit("eigenbasis", { count: pairs });
    }, [name, shape, vertices, pairs]);
    if (pairs) await page.waitForFunction((pairs) => window.chladni.app.bases.some((basis) => basis.count === pairs), pairs);
  };
  return { test, keep, saved, changed, datum, onSurface, upload, compute, violations, chooser, unfold, opened };
}

const AXE = readFileSync(join(ROOT, "web", "node_modules", "axe-core", "axe.min.js"), "utf8");
