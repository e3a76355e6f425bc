// Files for whoever looks: written in a thread of their own, then given to the browser as a download.

import type { Order } from "./files";
import { h } from "./dom";

/** Has a file written without keeping the page from answering. The code is fetched when a file is asked for. */
export async function write(order: Order): Promise<Blob> {
  const worker = new Worker(new URL("./fileworker.ts", import.meta.url), { type: "module" });
  try {
    return await new Promise<Blob>((resolve, reject) => {
      worker.onmessage = (event: MessageEvent<{ blob?: Blob; error?: string }>) =>
        event.data.blob ? resolve(event.data.blob) : reject(new Error(event.data.error));
      worker.onerror = (event) => reject(new Error(event.message || "the file could not be written"));
      worker.postMessage(order);
    });
  } finally {
    worker.terminate();
  }
}

/** Gives a file to the browser. */
export function give(blob: Blob, name: string) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  // The browser may take a moment to begin.
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** A name as a file may have it. */
export const fileName = (...parts: (string | null | undefined)[]) => parts.filter(Boolean).join("-").toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "-");
