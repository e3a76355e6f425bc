// The request behind what is shown, as a line for a shell and as Python.

import { key } from "./api";

export interface Request {
  method: string;
  path: string;
  body?: unknown;
  accept?: string;
}

/** Letters of a body that go on the line itself: Linux takes 128 KiB in one argument, and long lists of numbers are longer. */
const LINE = 100_000;

/** In a shell; quotes within the body are safe. */
export function curl({ method, path, body, accept }: Request): string {
  const quoted = (text: string) => `'${text.replaceAll("'", "'\\''")}'`;
  const parts = [`curl -sS ${quoted(location.origin + path)}`];
  if (key.get()) parts.push('-H "Authorization: Bearer $CHLADNI_KEY"');
  if (accept) parts.push(`-H ${quoted(`Accept: ${accept}`)}`);
  const text = body === undefined ? "" : JSON.stringify(body);
  const long = text.length > LINE;
  if (body !== undefined) parts.push("-H 'Content-Type: application/json'", long ? "--data-binary @-" : `-d ${quoted(text)}`);
  else if (method !== "GET") parts.push(`-X ${method}`);
  if (accept) parts.push("-o answer.bin");
  // Broken where a list goes on: a terminal takes 4095 letters of a line.
  return `${parts.join(" \\\n  ")}${long ? ` <<'JSON'\n${text.replace(/([^"]{1,2000}\d,)/g, "$1\n")}\nJSON\n` : ""}`;
}

/** In Python, with nothing but NumPy beside what it comes with. */
export function python({ method, path, body, accept }: Request): string {
  const raw = accept === "application/octet-stream";
  const headers = [
    ...(key.get() ? ['"Authorization": f"Bearer {os.environ[\'CHLADNI_KEY\']}"'] : []),
    ...(accept ? [`"Accept": "${accept}"`] : []),
    ...(body !== undefined ? ['"Content-Type": "application/json"'] : []),
  ];
  return [
    `import ${["json", ...(key.get() ? ["os"] : []), "urllib.request"].join(", ")}`,
    ...(raw ? ["import numpy as np"] : []),
    "",
    ...(body !== undefined ? [`body = ${literal(body)}`] : []),
    "request = urllib.request.Request(",
    `    ${JSON.stringify(location.origin + path)},`,
    ...(body !== undefined ? ["    data=json.dumps(body).encode(),"] : []),
    `    headers={${headers.join(", ")}},`,
    `    method="${method}",`,
    ")",
    "with urllib.request.urlopen(request) as answer:",
    raw ? '    values = np.frombuffer(answer.read(), "<f4")' : accept ? "    data = answer.read()" : "    result = json.load(answer)",
    "",
  ].join("\n");
}

/** JSON as Python writes it. */
export function literal(value: unknown): string {
  if (value === null || value === undefined) return "None";
  if (typeof value === "boolean") return value ? "True" : "False";
  // JSON has no other numbers, and writes null in their place.
  if (typeof value === "number" && !Number.isFinite(value)) return "None";
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object") return `{${Object.entries(value).filter(([, member]) => member !== undefined).map(([name, member]) => `${JSON.stringify(name)}: ${literal(member)}`).join(", ")}}`;
  return JSON.stringify(value);
}
