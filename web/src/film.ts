// A film of what a canvas shows.

/** What browsers record; Safari makes MP4 alone. */
const TYPES = ["video/webm", "video/mp4"];

const type = () => ("MediaRecorder" in window ? TYPES.find((type) => MediaRecorder.isTypeSupported(type)) : undefined);

/** Whether this browser records films. */
export const records = () => type() !== undefined;

/** Records a canvas for some seconds as WebM or MP4; `step` hears before each picture which part of that time has gone by since the last. */
export async function record(canvas: HTMLCanvasElement, seconds: number, step: (part: number) => void): Promise<Blob> {
  const stream = canvas.captureStream(30);
  const recorder = new MediaRecorder(stream, { mimeType: type(), videoBitsPerSecond: 8e6 });
  const parts: Blob[] = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  const ended = new Promise<void>((resolve) => (recorder.onstop = () => resolve()));
  recorder.start();
  const begin = performance.now();
  for (let last = begin, now = begin; now - begin < 1000 * seconds; last = now) {
    now = await new Promise<number>((resolve) => requestAnimationFrame(resolve));
    step(Math.max(now - last, 0) / (1000 * seconds));
  }
  recorder.stop();
  await ended;
  stream.getTracks().forEach((track) => track.stop());
  return new Blob(parts, { type: type() });
}
