import { readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";

/** What the licences of others ask to be passed on with their code: the bundle of the reference is embedded as it is. */
const notices: Plugin = {
  name: "notices",
  generateBundle() {
    for (const file of ["LICENSE", "NOTICE", "swagger-ui-bundle.js.LICENSE.txt"]) {
      const name = `swagger-ui-${file.replace(/^swagger-ui-|\.txt$/g, "").replaceAll(".", "-")}.txt`;
      this.emitFile({ type: "asset", name, source: readFileSync(`node_modules/swagger-ui-dist/${file}`) });
    }
  },
};

// Where the page is built to and where `npm run dev` finds a running server; Cargo's build script sets the first.
export default defineConfig({
  base: "./",
  plugins: [notices],
  build: {
    outDir: process.env.CHLADNI_PAGE ?? "dist",
    emptyOutDir: true,
    assetsDir: "page",
    // Nothing may be inlined: the content security policy allows no data in scripts and styles.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 2000,
    // The page, and the reference of the API.
    rollupOptions: { input: ["index.html", "reference.html"] },
  },
  server: {
    proxy: Object.fromEntries(
      ["/v1", "/docs", "/problems", "/openapi.json"].map((path) => [path, { target: process.env.CHLADNI_URL ?? "http://127.0.0.1:8080", changeOrigin: false }]),
    ),
  },
});
