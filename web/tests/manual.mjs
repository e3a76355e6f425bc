// The manual and the reference of the API in a real browser: `npm test`, after the page's own tests. With `-- --pictures` it takes the picture of the tutorial, too.

import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { createServer, request } from "node:http";
import { join } from "node:path";
import { browserPath, drawn, pageIsThere, ROOT, start } from "./harness.mjs";

if (!browserPath()) {
  console.log("skipped: no Chromium is installed (Debian: apt-get install chromium)");
  process.exit(0);
}
const SECRET = "5ecret-0f-the-manual-0123456789";
const site = await start(`reader:read+submit:${SECRET}`);
let failed = 0;
let passed = 0;

async function test(name, body) {
  const begin = performance.now();
  site.complaints.length = 0;
  try {
    await body();
    assert.deepEqual(site.complaints, [], "the browser complained");
    passed += 1;
    console.log(`ok      ${name} (${((performance.now() - begin) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed += 1;
    console.log(`FAILED  ${name}\n        ${String(error.stack ?? error).replaceAll("\n", "\n        ")}`);
  }
}

const AXE = readFileSync(join(ROOT, "web", "node_modules", "axe-core", "axe.min.js"), "utf8");
/** What a machine can check of WCAG 2.2 AA. */
async function accessible(page, what) {
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }));
  assert.deepEqual(violations.map(({ id, nodes }) => `${what} ${id}: ${nodes.slice(0, 4).map(({ target, failureSummary }) => `${target} ${failureSummary}`).join("; ")}`), []);
}
const operations = (page) => page.locator(".opblock");
/** Opens an operation of the reference, sends it as it stands, and gives the status. */
async function tried(page, id) {
  const block = page.locator(`.opblock[id$="-${id}"]`);
  await block.locator(".opblock-summary-control").click();
  await block.getByRole("button", { name: "Execute" }).click();
  const status = block.locator(".live-responses-table .response-col_status").last();
  await status.waitFor();
  return (await status.innerText()).trim().slice(0, 3);
}

try {
  if (!process.env.CHLADNI_DIST && !(await pageIsThere(site.url))) {
    console.log("skipped: this binary was built without its web page");
    await site.stop();
    process.exit(0);
  }

  await test("the manual is searched by keyboard, and a result opens its section", async () => {
    const page = await site.open("/docs/guide/");
    await page.keyboard.press("/");
    await page.keyboard.type("wave kernel");
    const options = page.getByRole("option");
    await options.first().waitFor();
    const found = await options.locator("strong").allInnerTexts();
    assert.ok(found.slice(0, 4).some((name) => name.startsWith("Signatures of points")), found.join(", "));
    await accessible(page, "search");
    const at = found.findIndex((name) => name.startsWith("Signatures of points"));
    for (let step = 0; step < at; step++) await page.keyboard.press("ArrowDown");
    assert.equal(await page.locator("[role=option][aria-selected=true] strong").innerText(), found[at]);
    await page.keyboard.press("Enter");
    await page.waitForURL("**/docs/guide/signatures*");
    await page.waitForSelector("body[data-ready]");
    const input = page.getByRole("combobox", { name: "Search the manual" });
    await input.fill("zzzz nothing has this");
    await page.getByText("Nothing has all of these words.").waitFor();
    await page.keyboard.press("Escape");
    assert.equal(await input.getAttribute("aria-expanded"), "false");
    // From a page in a folder, as well.
    await page.goto(`${site.url}/docs/guide/decisions/`);
    await page.waitForSelector("body[data-ready]");
    await input.fill("inertia");
    await options.first().click();
    await page.waitForURL(/docs\/guide\/[^?]+$/);
    await page.context().close();
  });

  await test("pages of the manual pass every check of WCAG 2.2 AA that a machine can make, light and dark", async () => {
    const page = await site.open("/docs/guide/");
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      for (const name of ["", "tutorial", "signatures", "benchmarks", "methods", "decisions/", "decisions/0020-cargo-builds-the-page"]) {
        await page.goto(`${site.url}/docs/guide/${name}`);
        await page.waitForSelector("body[data-ready]");
        await accessible(page, `${colorScheme} ${name}`);
      }
    }
    const back = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    assert.ok(Math.max(...back.match(/\d+/g).map(Number)) < 60, back);
    await page.context().close();
  });

  await test("every page of the manual fits a phone, and its pictures are there", async () => {
    const page = await site.open("/docs/guide/", { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
    assert.equal(await page.locator(".side").evaluate((side) => side.open), false);
    await page.locator(".side summary").click();
    const names = await page.locator(".side a").evaluateAll((links) => [...new Set(links.map((link) => link.href.split("#")[0]))]);
    assert.ok(names.length > 25, `${names.length}`);
    for (const name of names) {
      await page.goto(name);
      await page.waitForSelector("body[data-ready]");
      const width = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(width <= 390, `${name} is ${width} wide`);
      const broken = await page.evaluate(async () => {
        await Promise.all([...document.images].map((image) => image.decode().catch(() => {})));
        return [...document.images].filter((image) => image.naturalWidth === 0).map((image) => image.src);
      });
      assert.deepEqual(broken, [], name);
    }
    await page.context().close();
  });

  await test("operations of the reference are found by words of their descriptions, and tried with a key", async () => {
    const page = await site.open("/docs");
    const all = await operations(page).count();
    assert.ok(all > 40, `${all}`);
    assert.equal(await tried(page, "listMeshes"), "401");
    await page.getByRole("button", { name: "Authorize" }).first().click();
    await page.locator(".auth-container input").fill(SECRET);
    await page.locator(".auth-container").getByRole("button", { name: "Apply credentials" }).click();
    await page.locator(".auth-container").getByRole("button", { name: "Close" }).click();
    await page.locator(".opblock.is-open .opblock-summary-control").click();
    assert.equal(await tried(page, "listMeshes"), "200");
    await page.getByLabel("Search the operations").fill("similar points");
    await page.waitForFunction(() => document.querySelectorAll(".opblock").length < 4);
    assert.match(await operations(page).first().innerText(), /similar-points/);
    await page.context().close();
  });

  await test("links of before still lead to operations and types", async () => {
    const page = await site.open("/docs#uploadMesh");
    await page.locator('.opblock.is-open[id$="-uploadMesh"]').waitFor();
    await page.goto("about:blank");
    await page.goto(`${site.url}/docs#MeshResource`);
    await page.waitForURL("**/docs/plain#MeshResource");
    assert.ok(await page.locator("#MeshResource").count());
    await page.context().close();
  });

  await test("the reference passes the same checks, with an operation open", async () => {
    for (const colorScheme of ["light", "dark"]) {
      const page = await site.open("/docs#submitJob", { colorScheme });
      await page.locator(".opblock.is-open .opblock-body").waitFor();
      await accessible(page, colorScheme);
      await page.context().close();
    }
  });

  await test("both work behind a proxy with a path of its own", async () => {
    const proxy = createServer((wanted, answer) => {
      if (!wanted.url.startsWith("/spectral/")) return answer.writeHead(404).end();
      const { port, hostname } = new URL(site.url);
      const on = request({ port, hostname, path: wanted.url.slice(9), method: wanted.method, headers: { ...wanted.headers, host: `${hostname}:${port}` } }, (got) => {
        answer.writeHead(got.statusCode, got.headers);
        got.pipe(answer);
      });
      wanted.pipe(on);
    });
    await new Promise((resolve) => proxy.listen(0, "127.0.0.1", resolve));
    const base = `http://127.0.0.1:${proxy.address().port}/spectral`;
    const context = await site.browser.newContext();
    const page = await context.newPage();
    await page.goto(`${base}/docs/guide`);
    await page.waitForSelector("body[data-ready]");
    assert.equal(page.url(), `${base}/docs/guide/`);
    await page.getByRole("combobox").fill("certificate");
    await page.getByRole("option").first().waitFor();
    await page.getByRole("link", { name: "API", exact: true }).click();
    await page.waitForSelector("body[data-ready]");
    assert.equal(page.url(), `${base}/docs`);
    assert.equal(await tried(page, "health"), "200");
    await context.close();
    await new Promise((resolve) => proxy.close(resolve));
  });

  if (process.argv.includes("--pictures")) {
    const open = await start();
    const page = await open.open("/", { viewport: { width: 1040, height: 620 } });
    await page.locator(".welcome").getByRole("button", { name: "starfish" }).click();
    await page.waitForFunction(() => document.body.dataset.mode === "11" && window.chladni.viewer.moving);
    await page.getByRole("button", { name: "Animate" }).click();
    await page.getByRole("tab", { name: "Distances" }).click();
    await page.locator(".panel:not([hidden])").getByLabel("Show", { exact: true }).selectOption("similar");
    // The highest point of the surface on the screen: the tip of an arm.
    const [x, y] = await page.evaluate(() => {
      const { viewer } = window.chladni;
      const box = viewer.canvas.getBoundingClientRect();
      for (let y = box.top; y < box.bottom; y += 2) {
        for (let x = box.left; x < box.right; x += 4) if (viewer.pick(x, y)) return [x, y + 6];
      }
      throw new Error("the surface is nowhere");
    });
    const answered = page.waitForResponse((answer) => answer.url().endsWith("/similar-points"));
    await page.mouse.click(x, y);
    await answered;
    await drawn(page);
    writeFileSync(join(ROOT, "docs", "pictures", "tutorial.png"), await page.screenshot());
    await open.stop();
  }
} finally {
  await site.stop();
}
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed === 0 ? 0 : 1);
