// Where one is: everything that a permalink keeps, in the fragment of the address.

import { AXES, type Up } from "./upright";

export interface Place {
  mesh?: string;
  basis?: string;
  tab: string;
  mode: number;
  view?: string;
  map?: string;
  lines?: number;
  up?: Up;
  /** What was drawn or chosen in the open tab, packed. */
  design?: string;
}

/** Packs what a tab keeps, so that an address holds it as it is: base64 of JSON, in the letters of addresses. */
export const pack = (value: unknown) => btoa(JSON.stringify(value)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");

/** What was packed; null where that cannot be read. */
export function unpack<T>(text: string | undefined): T | null {
  if (!text) return null;
  try {
    return JSON.parse(atob(text.replaceAll("-", "+").replaceAll("_", "/"))) as T;
  } catch {
    return null;
  }
}

export function read(): Place {
  const entries = new URLSearchParams(location.hash.slice(1));
  const text = (name: string) => entries.get(name) ?? undefined;
  const mode = Number(text("mode") ?? 1);
  return {
    mesh: text("mesh"),
    basis: text("basis"),
    tab: text("tab") ?? "modes",
    mode: Number.isInteger(mode) && mode >= 0 ? mode : 1,
    view: text("view"),
    map: text("map"),
    lines: text("lines") === undefined ? undefined : Number(text("lines")) || 0,
    up: Object.hasOwn(AXES, text("up") ?? "") ? (text("up") as Up) : undefined,
    design: text("design"),
  };
}

/** Whether two places are one. */
export const same = (one: Place, other: Place) => (Object.keys({ ...one, ...other }) as (keyof Place)[]).every((name) => (one[name] ?? "") === (other[name] ?? ""));

/** Writes the place into the address; a new entry in the history only where `step` is set. */
export function write(place: Place, step: boolean) {
  const entries = new URLSearchParams();
  for (const [name, value] of Object.entries(place)) if (value !== undefined && value !== "") entries.set(name, String(value));
  const address = `#${entries}`;
  window.clearTimeout(again);
  if (address === location.hash) return;
  try {
    if (step) history.pushState(null, "", address);
    else history.replaceState(null, "", address);
  } catch {
    // Refused: see below.
  }
  // Browsers take so many changes in so many seconds, and a slider makes more: some drop the rest without a word, others throw.
  if (new URL(address, location.href).hash !== location.hash) again = window.setTimeout(() => write(place, step), LATER);
}

let again = 0;

/** Milliseconds after which an address that a browser refused is tried again. */
const LATER = 1000;

/** An address that was refused is of no use any more: another one has come. */
export const forget = () => window.clearTimeout(again);
