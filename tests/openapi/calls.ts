// What the README and the walk through the API do, through a client that knows nothing but the document. A type that is wrong does not compile, and a
// server that answers otherwise fails.

import createClient from "openapi-fetch";
import type { components, paths } from "../../web/src/openapi.js";

declare const process: { argv: string[] };

const client = createClient<paths, "application/json">({ baseUrl: process.argv[2] });
const files = createClient<paths>({ baseUrl: process.argv[2] });

function must<T>(what: string, answer: { data?: T; error?: unknown }): T {
  if (answer.data === undefined) throw new Error(`${what}: ${JSON.stringify(answer.error)}`);
  return answer.data;
}

function check(what: string, holds: boolean) {
  if (!holds) throw new Error(what);
}

/** A grid of n × n vertices, curved, as OBJ. */
function surface(n: number): Blob {
  const lines: string[] = [];
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) lines.push(`v ${i / n} ${j / n} ${0.2 * Math.sin((4 * i) / n) * Math.cos((3 * j) / n)}`);
  for (let i = 0; i + 1 < n; i++) {
    for (let j = 0; j + 1 < n; j++) {
      const [a, b, c, d] = [i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j + 2, i * n + j + 2];
      lines.push(`f ${a} ${b} ${c}`, `f ${a} ${c} ${d}`);
    }
  }
  return new Blob([lines.join("\n") + "\n"]);
}

async function finished(id: string): Promise<components["schemas"]["JobResource"]> {
  const job = must("job", await client.GET("/v1/jobs/{id}", { params: { path: { id }, query: { wait: "60s" } } }));
  check(`the job ended as ${job.status}: ${job.problem?.detail}`, job.status === "succeeded");
  return job;
}

// 1: a file.
const mesh = must(
  "upload",
  await files.POST("/v1/meshes", {
    params: { query: { name: "a sheet", merge: "auto" } },
    body: surface(24),
    bodySerializer: (body) => body as Blob,
    headers: { "Content-Type": "model/obj" },
  }),
);
check("the report has an area", mesh.report.area > 1 && mesh.report.genus === 0 && mesh.report.defects.length === 0);

// 2: a job of few words; 3: its end.
const job = must("job", await client.POST("/v1/jobs", { body: { kind: "eigenbasis", mesh: mesh.id, parameters: { count: 20 } } }));
const done = await finished(job.id);

// 4: its basis.
const basis = must("basis", await client.GET("/v1/bases/{id}", { params: { path: { id: done.basis! } } }));
check("it is an eigenbasis", basis.kind === "eigenbasis");
if (basis.kind === "eigenbasis") {
  check("it has bounds", basis.certificate.bounds.length === 20 && basis.eigenvalues.length === 20);
  check("it says which operator it is of", basis.operator !== null && "laplacian" in basis.operator && basis.operator.laplacian === "cotangent");
}

// 5: the file with all of it.
const file = must("content", await client.GET("/v1/bases/{id}/content", { params: { path: { id: basis.id } }, parseAs: "blob" }));
check("it is an NPZ", file.size === basis.bytes);

// 6: pairs to a tolerance, proven complete.
const exact = must(
  "exact job",
  await client.POST("/v1/jobs", {
    body: { kind: "eigenbasis", mesh: mesh.id, parameters: { method: "hsim", count: 15, tolerance: 1e-8, precision: "f64", operator: { extrinsic: { t: 0.25 } } }, priority: 1 },
  }),
);
const proven = must("exact basis", await client.GET("/v1/bases/{id}", { params: { path: { id: (await finished(exact.id)).basis! } } }));
check("it is complete", proven.kind === "eigenbasis" && proven.certificate.complete === true);
if (exact.kind === "eigenbasis" && exact.parameters.method === "hsim") check("the tolerance is told", exact.parameters.tolerance === 1e-8);

// 7: a filter.
const filtered = must(
  "filter",
  await client.POST("/v1/bases/{id}/filter", {
    params: { path: { id: basis.id } },
    body: { functions: "coordinates", transfer: { kind: "low_pass", cutoff: 250 } },
  }),
);
check("there is a row for each vertex", filtered.columns === 3 && filtered.values.length === 3 * mesh.vertices);

// 8: distances.
const distances = must(
  "distances",
  await client.POST("/v1/bases/{id}/distances", {
    params: { path: { id: basis.id }, query: { dtype: "f64" } },
    body: { distance: { kind: "geodesic", method: "heat" }, sources: [0] },
  }),
);
check("distances are known everywhere", distances.values.every((value) => value !== null && value >= 0));

// 9: signatures.
const signatures = must(
  "signatures",
  await client.POST("/v1/bases/{id}/signatures", {
    params: { path: { id: basis.id } },
    body: { signature: { kind: "heat_kernel", count: 4 }, vertices: [0, 17] },
  }),
);
check("signatures have columns", signatures.columns === 4);

// 10: eigenfunctions, and what went on meanwhile.
const modes = must("modes", await client.GET("/v1/bases/{id}/modes", { params: { path: { id: basis.id }, query: { from: 1, to: 3, format: "f32" } }, parseAs: "blob" }));
check("two columns of f32", modes.size === 2 * 4 * mesh.vertices);
const listed = must("list", await client.GET("/v1/jobs", { params: { query: { status: "succeeded", limit: 10 } } }));
check("both jobs are listed", listed.items.length === 2 && listed.next === null);

// What is refused says why.
const refused = await files.POST("/v1/jobs", { body: { kind: "eigenbasis", mesh: mesh.id, parameters: { count: 0 } } });
check("a count of nothing is refused by name", refused.error?.detail.includes("count") === true);
console.log("the ten calls: done");
