// A server of its own with an empty folder, and a browser that draws in software. Nothing here waits for a time to pass: every wait
// is for something that the page or the server says.

import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const ROOT = join(dirname(fileURLToPath(import.meta.url)), "..", "..");
const BINARY = process.env.CHLADNI_BINARY ?? join(ROOT, "target", "release", "chladni");

/** The first browser that is installed. */
export function browserPath() {
  const names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
  const folders = (process.env.PATH ?? "").split(delimiter);
  const candidates = [process.env.CHLADNI_CHROMIUM, ...names.flatMap((name) => folders.map((folder) => join(folder, name)))];
  return candidates.find((path) => path && existsSync(path));
}

/** A mesh made by the binary. */
export function sample(folder, shape, vertices) {
  const path = join(folder, `${shape}-${vertices}.ply`);
  execFileSync(BINARY, ["sample", shape, "--vertices", String(vertices), "--output", path], { stdio: "ignore" });
  return path;
}

/** Starts server and browser; with `keys`, a server that asks for one of them. */
export async function start(keys) {
  const folder = mkdtempSync(join(tmpdir(), "chladni-page-"));
  const server = spawn(BINARY, ["serve", "--listen", "127.0.0.1:0", "--data", join(folder, "data"), "--log-level", "warn", "--drain-seconds", "0.1"], { stdio: ["ignore", "pipe", "inherit"], env: { ...process.env, ...(keys ? { CHLADNI_KEYS: keys } : {}) } });
  const url = await new Promise((resolve, reject) => {
    createInterface({ input: server.stdout }).on("line", (line) => {
      const found = /listening on (\S+)/.exec(line);
      if (found) resolve(found[1]);
    });
    server.once("exit", (code) => reject(new Error(`the server ended with ${code}`)));
  });
  // As headless Chromium draws by itself where there is no graphics card: WebGL by SwiftShader, the page by the processor.
  const browserServer = await chromium.launchServer({
    executablePath: browserPath(),
    args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--autoplay-policy=no-user-gesture-required"],
  });
  const browser = await chromium.connect(browserServer.wsEndpoint());
  const complaints = [];
  const policy = (await fetch(url)).headers.get("content-security-policy");

  /** A page that notes every error and every request that leaves the server. */
  const open = async (path = "/", options = {}) => {
    const context = await browser.newContext({ viewport: { width: 1100, height: 700 }, colorScheme: "light", ...options });
    if (process.env.CHLADNI_DIST) {
      // The page as Vite just built it, in place of the one in the binary: for work on the page alone.
      await context.route(/\/(page\/[^/]*|icon\.svg|docs)?(\?.*)?(#.*)?$/, (route) => {
        const path = new URL(route.request().url()).pathname;
        if (!/^\/($|page\/|icon|docs$)/.test(path)) return route.fallback();
        const headers = policy?.includes("script-src") ? { "content-security-policy": policy } : {};
        return route.fulfill({ path: join(process.env.CHLADNI_DIST, path === "/" ? "index.html" : path === "/docs" ? "reference.html" : path), headers });
      });
    }
    const page = await context.newPage();
    page.setDefaultTimeout(30_000);
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("console", (message) => {
      // A refused request is logged by the browser whatever the page makes of it.
      if (message.type() === "error" && !message.text().startsWith("Failed to load resource")) complaints.push(message.text());
    });
    page.on("request", (request) => {
      if (!request.url().startsWith(url) && !/^(data|blob):/.test(request.url())) complaints.push(`a request to ${request.url()}`);
    });
    await page.goto(url + path);
    await page.waitForSelector("body[data-ready]");
    return page;
  };
  const stop = async () => {
    await browser.close();
    await browserServer.close();
    server.removeAllListeners("exit");
    const gone = new Promise((resolve) => server.once("exit", resolve));
    if (server.exitCode === null) {
      server.kill("SIGTERM");
      await gone;
    }
    rmSync(folder, { recursive: true, force: true });
  };
  return { url, folder, open, stop, complaints, browser, browserPid: browserServer.process().pid };
}

/** The page is in this binary. */
export async function pageIsThere(url) {
  return (await (await fetch(url)).text()).includes("/page/");
}

/** Waits until the surface is drawn as well as it can be, unless it moves. */
export const drawn = (page) => page.waitForFunction(() => window.chladni.viewer.fine || window.chladni.viewer.moving);

/** The surface as it stands on the screen: the bytes of the PNG change with any pixel. */
export async function picture(page) {
  await drawn(page);
  return page.locator(".stage").screenshot();
}
