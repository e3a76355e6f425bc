import { defineConfig } from "vite";

// The viewer alone, as one classic script without imports, for notebooks. Cargo's build script says where it goes.
export default defineConfig({
  publicDir: false,
  build: {
    outDir: process.env.CHLADNI_WIDGET ?? "dist-widget",
    emptyOutDir: true,
    chunkSizeWarningLimit: 2000,
    modulePreload: { polyfill: false },
    rollupOptions: { input: "src/widget.ts", output: { format: "iife", entryFileNames: "widget.js", inlineDynamicImports: true } },
  },
});
