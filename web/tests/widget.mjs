// The page's viewer in a notebook: the frame of the Python package, with the script that Vite makes for it.

import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { build } from "vite";
import { ROOT } from "./harness.mjs";
import { kit } from "./kit.mjs";

const FRAME = join(ROOT, "python", "chladni", "_view.html");

export async function widget(site) {
  const { test, opened } = kit(site);

  await test("a notebook shows modes with the page's viewer, which needs nothing from elsewhere", async () => {
    const folder = mkdtempSync(join(tmpdir(), "chladni-widget-"));
    try {
      process.env.CHLADNI_WIDGET = folder;
      await build({ root: join(ROOT, "web"), configFile: join(ROOT, "web", "vite.widget.config.ts"), logLevel: "error" });
      const script = gzipSync(readFileSync(join(folder, "widget.js"))).toString("base64");
      const page = await site.open();
      await opened(page, "ball", "sphere", 1200, 12);
      const data = await page.evaluate(async () => {
        const { mesh, bases } = window.chladni.app;
        const get = async (path, type) => new Uint8Array(await (await fetch(path, { headers: { Accept: type } })).arrayBuffer());
        const text = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
        const basis = await (await fetch(`/v1/bases/${bases[0].id}`)).json();
        const modes = await Promise.all(basis.eigenvalues.map((_, k) => get(`${basis.links.modes}?from=${k}&to=${k + 1}&format=f32`, "application/octet-stream")));
        const whole = new Uint8Array(modes.length * modes[0].length);
        modes.forEach((mode, k) => whole.set(mode, k * mode.length));
        return { surface: text(await get(mesh.links.content, "application/vnd.chladni.mesh")), modes: text(whole), values: basis.eigenvalues, first: 1, closed: true };
      });
      const html = readFileSync(FRAME, "utf8").replace("SCRIPT", () => script).replace("DATA", () => JSON.stringify(data));
      // As a notebook has it: a frame whose scripts reach nothing around it.
      const context = await site.browser.newContext({ viewport: { width: 640, height: 420 } });
      const notebook = await context.newPage();
      notebook.on("pageerror", (error) => site.complaints.push(error.message));
      notebook.on("request", (request) => /^(data|blob|about):/.test(request.url()) || site.complaints.push(`a request to ${request.url()}`));
      await notebook.setContent(`<iframe sandbox="allow-scripts" title="Modes" style="width:600px;height:400px;border:0" srcdoc="${html.replaceAll("&", "&amp;").replaceAll('"', "&quot;")}"></iframe>`);
      const frame = notebook.frameLocator("iframe");
      await frame.locator("body[data-mode='1']").waitFor();
      const canvas = frame.locator("canvas.surface");
      const [before, value] = [await canvas.screenshot(), await frame.locator("output.value").textContent()];
      assert.equal(value, `λ = ${Number(data.values[1].toPrecision(3))}`);
      await frame.getByRole("slider", { name: "Mode" }).fill("7");
      await frame.locator("body[data-mode='7']").waitFor();
      assert.notDeepEqual(await canvas.screenshot(), before);
      await frame.getByRole("button", { name: "Animate" }).click();
      await frame.locator("button[aria-pressed='true']").waitFor();
      await frame.getByRole("button", { name: "Animate" }).click();
      if (process.argv.includes("--pictures")) await notebook.screenshot({ path: join(ROOT, "web", "tests", "pictures", "widget.png") });
      await context.close();
      await page.context().close();
    } finally {
      rmSync(folder, { recursive: true, force: true });
    }
  });
}
