// The public endpoints of the server, and nothing else: what any other front-end would call.

import type { Request } from "./code";
import { give } from "./give";
import type { components } from "./openapi";

/** What the server's document says of requests and answers. */
type Schemas = components["schemas"];

/** A problem; that of a server that cannot be reached, or of a job, has no status. */
export type Problem = Omit<Schemas["Problem"], "status"> & { status?: number };

/** An error in the server's own words. */
export class ApiError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

export type Mesh = Schemas["MeshResource"];
export type Job = Schemas["JobResource"];
export type Status = Schemas["Status"];
export type BasisSummary = Schemas["BasisSummary"];
export type Basis = Schemas["BasisResource"];
export type Eigenbasis = Extract<Basis, { kind: "eigenbasis" }>;
export type JobRequest = Schemas["JobRequest"];

/** The kinds of job. */
export type Kind = JobRequest["kind"];

/** The parameters of a kind of job. */
export type Parameters<K extends Kind> = Extract<JobRequest, { kind: K }>["parameters"];

/** Whether a mesh bounds one solid, so that of its triangles only the outer sides are ever seen. */
export const hasInside = ({ report: { closed, manifold, orientable, components } }: Mesh) => closed && manifold && orientable && components === 1;

export interface Page<T> {
  items: T[];
  next: string | null;
}

export const ended = (status: Status) => status === "succeeded" || status === "failed" || status === "canceled";

const KEY = "chladni-key";

/** The API key, where the server wants one; it stays in this tab. */
export const key = {
  get: () => sessionStorage.getItem(KEY) ?? "",
  set: (secret: string) => (secret ? sessionStorage.setItem(KEY, secret) : sessionStorage.removeItem(KEY)),
};

/** The header that carries the key. A browser refuses letters beyond ASCII in its own words, and what is copied may bring some along unseen. */
function authorization(): string {
  if (/[^\x21-\x7e]/.test(key.get())) throw new ApiError({ type: "", title: "This cannot be an API key", status: 401, detail: "It has a character that no request can carry: a space, or one beyond ASCII. Was something else copied with it?" });
  return `Bearer ${key.get()}`;
}

// The page draws the mesh that was kept of a file, and numbers vertices and faces as that does.
const numbered = /^\/v1\/(functional-maps|meshes\/[^/?]+\/(?:frames|surface)|bases\/[^/?]+\/(?!content)[^?]+)(\?|$)/;

/** The path of a request in which vertices and faces are numbered as the kept mesh does. */
export const kept = (path: string, method = "GET") =>
  numbered.test(path) || (/^\/v1\/(jobs|job-estimates)$/.test(path) && method === "POST") ? `${path}${path.includes("?") ? "&" : "?"}numbering=kept` : path;

/** The last request for something that is shown, as one would send it oneself. */
export const recent: { shown: Request | null } = { shown: null };

const shows = /^\/v1\/(bases\/[^/?]+\/(?!content)[^?]+|shape-comparisons|functional-maps)/;

/** What a server that does not answer is called; once it answers again, `reached` happens to the document. */
export const UNREACHABLE = "The server cannot be reached";
let reached = true;

/** Takes note of whether the server answered. */
function answered(now: boolean) {
  const again = now && !reached;
  reached = now;
  if (again) document.dispatchEvent(new Event("reached"));
}

/** Sends a request; whatever is no success becomes an [`ApiError`]. */
export async function send(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = new Headers(init.headers);
  if (shows.test(path)) {
    const body = typeof init.body === "string" ? (JSON.parse(init.body) as unknown) : undefined;
    recent.shown = { method: init.method ?? "GET", path: kept(path, init.method), body, accept: headers.get("Accept") ?? undefined };
  }
  if (key.get()) headers.set("Authorization", authorization());
  let response: Response;
  try {
    response = await fetch(kept(path, init.method), { ...init, headers });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    answered(false);
    throw new ApiError({ type: "", title: UNREACHABLE, detail: "No answer came. Is it still running?" });
  }
  answered(true);
  if (!response.ok) throw new ApiError(await problemOf(response));
  return response;
}

async function problemOf(response: Response): Promise<Problem> {
  const text = await response.text();
  try {
    return JSON.parse(text) as Problem;
  } catch {
    return { type: "", title: `The server answered ${response.status}`, status: response.status, detail: text.slice(0, 300) || response.statusText };
  }
}

/** Reads JSON; of an answer that is none, an error that names it. */
async function read<T>(response: Response): Promise<T> {
  const text = await response.text();
  try {
    return JSON.parse(text) as T;
  } catch {
    throw new Error(`${response.url} answered ${response.status} with ${text.length} characters that are not JSON: ${text.slice(0, 100)}`);
  }
}

export const get = async <T>(path: string): Promise<T> => read<T>(await send(path));

/** Fetches a file with the API key and gives it to the browser as a download. */
export const save = async (path: string, name: string) => give(await (await send(path)).blob(), name);

/** A mesh with other positions as a file, with the texture coordinates, normals and names that its own file had. */
export const movedSurface = async (mesh: string, positions: Float32Array, format: "obj" | "ply" | "glb") =>
  (await send(`/v1/meshes/${mesh}/surface?format=${format}`, {
    method: "POST", body: positions as Float32Array<ArrayBuffer>, headers: { "Content-Type": "application/octet-stream", Accept: "*/*" },
  })).blob();

/** Posts JSON and reads JSON. */
export const post = async <T>(path: string, body?: unknown, init: RequestInit = {}): Promise<T> =>
  read<T>(
    await send(path, {
      method: "POST",
      ...(body === undefined ? {} : { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } }),
      ...init,
    }),
  );

/** Renames a mesh. */
export const rename = async (id: string, name: string): Promise<Mesh> =>
  read<Mesh>(await send(`/v1/meshes/${id}`, { method: "PATCH", body: JSON.stringify({ name }), headers: { "Content-Type": "application/json" } }));

/** Deletes a mesh with its jobs and bases. */
export const remove = (id: string) => send(`/v1/meshes/${id}?cascade=true`, { method: "DELETE" });

/** Raw single-precision numbers: a row for each vertex or face. */
export async function numbers(path: string, init: RequestInit = {}): Promise<Float32Array> {
  const headers = { Accept: "application/octet-stream", ...(init.headers as Record<string, string>) };
  return new Float32Array(await (await send(path, { ...init, headers })).arrayBuffer());
}

/** Posts JSON and reads raw numbers. */
export const postNumbers = (path: string, body: unknown, signal?: AbortSignal) =>
  numbers(path, { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" }, signal });

/** Positions and triangles, as they go to the graphics card: two counts, then numbers. */
export async function meshContent(path: string, progress: (fraction: number) => void): Promise<ArrayBuffer> {
  const response = await send(path, { headers: { Accept: "application/vnd.chladni.mesh" } });
  const length = Number(response.headers.get("Content-Length"));
  if (!(length > 4e6) || !response.body) return response.arrayBuffer();
  const whole = new Uint8Array(length);
  let at = 0;
  for (const reader = response.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) return whole.buffer;
    whole.set(value, at);
    at += value.length;
    progress(at / length);
  }
}

/** Endings of files by which the server knows their format; what has another may still begin like one of them, and is looked at. */
export const ENDINGS = ["obj", "ply", "off", "coff", "noff", "stl", "mesh", "meshb", "vtk", "vtp", "vtu", "msh", "gmsh", "surf", "fsurf", "pial", "white", "orig", "smoothwm", "inflated", "sphere", "gltf", "glb", "gii", "gifti", "npz", "json"];

const unpacked = (file: string) => file.replace(/\.(gz|zst)$/i, "");

/** What the mesh of a file is called: its name without endings. */
export const stem = (file: string) => unpacked(file).replace(/\.[^.]+$/, "").slice(0, 200);

/** Uploads a file under its name; `sent` hears which fraction is on its way. */
export function upload(file: File, sent: (fraction: number) => void): Promise<Mesh> {
  // fetch cannot tell how much of a body has been sent.
  const request = new XMLHttpRequest();
  const plain = unpacked(file.name);
  const ending = /\.([^.]+)$/.exec(plain)?.[1]?.toLowerCase();
  const query = new URLSearchParams({ name: stem(file.name) });
  if (ending && ENDINGS.includes(ending)) query.set("format", ending);
  request.open("POST", `/v1/meshes?${query}`);
  request.setRequestHeader("Content-Type", "application/octet-stream");
  if (plain !== file.name) request.setRequestHeader("Content-Encoding", /\.gz$/i.test(file.name) ? "gzip" : "zstd");
  if (key.get()) request.setRequestHeader("Authorization", authorization());
  request.upload.onprogress = (event) => sent(event.loaded / event.total);
  return new Promise((resolve, reject) => {
    const fail = (problem: Problem) => reject(new ApiError(problem));
    request.onload = () => {
      let answer: unknown;
      try {
        answer = JSON.parse(request.responseText);
      } catch {
        fail({ type: "", title: "The upload failed", detail: `The server answered ${request.status}.` });
        return;
      }
      if (request.status < 300) resolve(answer as Mesh);
      else fail(answer as Problem);
    };
    request.onerror = () => fail({ type: "", title: UNREACHABLE, detail: "The upload did not get through." });
    request.send(file);
  });
}

/** Tells every change of a job until it has ended or `signal` stops it; a lost connection is taken up where it broke. */
export async function watch(job: Job, changed: (job: Job) => void, signal: AbortSignal): Promise<Job> {
  // Not EventSource: that one cannot carry an API key.
  let latest = job;
  for (let failures = 0; !ended(latest.status); ) {
    try {
      const response = await send(latest.links.events, { headers: { "Last-Event-ID": String(latest.revision) }, signal });
      if (response.status === 204 || !response.body) {
        latest = await get<Job>(latest.links.self);
        changed(latest);
        continue;
      }
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        text += value;
        for (let end = text.indexOf("\n\n"); end >= 0; end = text.indexOf("\n\n")) {
          const data = /^data: ?(.*)$/m.exec(text.slice(0, end));
          text = text.slice(end + 2);
          if (!data) continue;
          failures = 0;
          latest = JSON.parse(data[1]) as Job;
          changed(latest);
        }
      }
    } catch (error) {
      if (signal.aborted || (error instanceof ApiError && (error.problem.status ?? 500) < 500)) throw error;
      failures += 1;
      if (failures > 5) throw error;
      await new Promise((resolve) => setTimeout(resolve, 500 * failures));
    }
  }
  return latest;
}
