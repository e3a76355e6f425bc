// The thread in which large meshes are prepared.

import { prepare } from "./geometry";

self.onmessage = (event: MessageEvent<ArrayBuffer>) => {
  const done = prepare(event.data);
  // The first level and the positions lie in the buffer that came.
  const buffers = [event.data, done.normals.buffer, ...done.levels.slice(1).map((level) => level.buffer)];
  (self as unknown as { postMessage(message: unknown, transfer: Transferable[]): void }).postMessage(done, buffers as Transferable[]);
};
