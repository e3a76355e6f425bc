// The request behind what is shown, as a line for a shell and as Python.

import { key } from "./api";

export interface Request {
  method: string;
  path: string;
  body?: unknown;
  accept?: string;
}

/** In a shell; quotes within the body are safe. */
export function curl({ method, path, body, accept }: Request): string {
  const quoted = (text: string) => `'${text.replaceAll("'", "'\\''")}'`;
  const parts = [`curl -sS ${quoted(location.origin + path)}`];
  if (key.get()) parts.push('-H "Authorization: Bearer $CHLADNI_KEY"');
  if (accept) parts.push(`-H ${quoted(`Accept: ${accept}`)}`);
  if (body !== undefined) parts.push("-H 'Content-Type: application/json'", `-d ${quoted(JSON.stringify(body))}`);
  else if (method !== "GET") parts.push(`-X ${method}`);
  if (accept) parts.push("-o answer.bin");
  return parts.join(" \\\n  ");
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
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object") return `{${Object.entries(value).filter(([, member]) => member !== undefined).map(([name, member]) => `${JSON.stringify(name)}: ${literal(member)}`).join(", ")}}`;
  return JSON.stringify(value);
}
