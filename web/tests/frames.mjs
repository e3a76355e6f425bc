// How many pictures a second the page draws while something moves, and what each of them costs: `npm run frames`, after
// `cargo build --release`. The window is 1100 × 700, the browser draws in software.
//
//   npm run frames                       25,000 vertices
//   npm run frames -- --vertices 500000  a million faces
//   npm run frames -- --seconds 10       measure for longer
//   npm run frames -- --whole            all triangles and all pixels, however slow
//
// The rate is what one sees: pictures of the page by the time between the first and the last. The processor's seconds are those of
// all processes of the browser, so that they mean something on a busy machine too.

import { readdirSync, readFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { sample, start } from "./harness.mjs";

const { values: options } = parseArgs({ options: { vertices: { type: "string", default: "25000" }, seconds: { type: "string", default: "5" }, shape: { type: "string", default: "knot" }, whole: { type: "boolean", default: false } } });
const seconds = Number(options.seconds);

/** Processor seconds of a process and all that it has started. */
function spent(root) {
  const parents = new Map();
  const used = new Map();
  for (const name of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const text = readFileSync(`/proc/${name}/stat`, "utf8");
      const fields = text.slice(text.lastIndexOf(")") + 2).split(" ");
      parents.set(Number(name), Number(fields[1]));
      used.set(Number(name), (Number(fields[11]) + Number(fields[12])) / 100);
    } catch {
      // It has ended in between.
    }
  }
  const below = (id) => id === root || (parents.has(id) && id > 1 && below(parents.get(id)));
  return [...used].filter(([id]) => below(id)).reduce((sum, [, value]) => sum + value, 0);
}

const site = await start();
try {
  const page = await site.open();
  const file = sample(site.folder, options.shape, Number(options.vertices));
  // What the page was busy with at a stretch: the browser's own list of long tasks leaves out waiting for what is drawn.
  const session = await site.browser.newBrowserCDPSession();
  let events = [];
  session.on("Tracing.dataCollected", ({ value }) => events.push(...value));
  const listen = async () => {
    events = [];
    await session.send("Tracing.start", { traceConfig: { includedCategories: ["toplevel"], excludedCategories: ["*"] } });
  };
  const longest = async () => {
    const complete = new Promise((resolve) => session.once("Tracing.tracingComplete", resolve));
    await session.send("Tracing.end");
    await complete;
    const main = new Set(events.filter(({ name, args }) => name === "thread_name" && args.name === "CrRendererMain").map(({ pid, tid }) => `${pid}/${tid}`));
    const tasks = events.filter(({ name, pid, tid }) => name.endsWith("RunTask") && main.has(`${pid}/${tid}`)).map(({ dur }) => dur / 1000).sort((a, b) => b - a);
    return `the page was busy for at most ${tasks[0].toFixed(0)} ms at a stretch (then ${tasks[1].toFixed(0)} and ${tasks[2].toFixed(0)})`;
  };
  const begin = performance.now();
  await listen();
  await page.setInputFiles("#file", file);
  await page.waitForFunction(() => window.chladni.app.mesh && document.querySelector(".panel:not([hidden]) form"), null, { timeout: 120_000 });
  await page.waitForFunction(() => window.chladni.viewer.fine, null, { timeout: 120_000 });
  console.log(`opened and drawn after ${((performance.now() - begin) / 1000).toFixed(1)} s; ${await longest()}`);
  const compute = async (count) => {
    const form = page.locator(".panel:not([hidden]) form");
    if (count) for (const [label, value] of Object.entries(count)) await form.getByLabel(label, { exact: true }).fill(value);
    await form.getByRole("button", { name: "Compute" }).click();
  };
  const measure = async (name, moving = async (until) => page.waitForTimeout(until - performance.now())) => {
    await page.waitForTimeout(1500);
    await listen();
    const pid = site.browserPid;
    const [before, cpu, at] = [await page.evaluate(() => window.chladni.viewer.statistics.frames), spent(pid), performance.now()];
    await moving(at + 1000 * seconds);
    const [after, cpu2, end] = [await page.evaluate(() => window.chladni.viewer.statistics.frames), spent(pid), performance.now()];
    const frames = after - before;
    const last = await page.evaluate(() => window.chladni.viewer.statistics);
    console.log(`${name.padEnd(28)} ${((1000 * frames) / (end - at)).toFixed(1).padStart(6)} frames a second, ${((1000 * (cpu2 - cpu)) / frames).toFixed(1)} ms of processor a frame, ${last.triangles} triangles on ${last.pixels} pixels at the end; ${await longest()}`);
  };
  await compute({ Eigenpairs: "40" });
  await page.waitForFunction(() => document.body.dataset.mode !== undefined, null, { timeout: 300_000 });
  if (options.whole) await page.evaluate(() => window.chladni.viewer.pace.hold());
  await page.getByRole("slider", { name: "Mode" }).fill("12");
  await page.getByRole("button", { name: "Animate" }).click();
  await measure("a mode swings");
  await page.getByRole("button", { name: "Animate" }).click();
  const box = await page.locator("canvas.surface").boundingBox();
  await page.mouse.move(box.x + 40, box.y + 40);
  await page.mouse.down();
  await measure("the camera turns", async (until) => {
    // As fast as a mouse tells where it is, whether or not the page has drawn the last move.
    for (let k = 0; performance.now() < until; k++) {
      void page.mouse.move(box.x + 200 + 150 * Math.sin(k / 15), box.y + 200 + 50 * Math.cos(k / 20)).catch(() => {});
      await new Promise((resolve) => setTimeout(resolve, 12));
    }
  });
  await page.mouse.up();
  if (Number(options.vertices) <= 60_000) {
    await page.getByRole("tab", { name: "Vibration" }).click();
    await compute({ Modes: "20" });
    await page.locator(".panel:not([hidden])").getByText(/Hz; 6 rigid/).waitFor({ timeout: 300_000 });
    await page.getByRole("button", { name: "Tap" }).click();
    await measure("a tapped surface rings");
  }
} finally {
  await site.stop();
}
