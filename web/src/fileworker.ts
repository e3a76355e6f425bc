// The thread in which files are written: a surface of a million vertices is 80 MB of text.

import { written, type Order } from "./files";

self.onmessage = (event: MessageEvent<Order>) => {
  written(event.data).then(
    (blob) => self.postMessage({ blob }),
    (error: unknown) => self.postMessage({ error: error instanceof Error ? error.message : String(error) }),
  );
};
