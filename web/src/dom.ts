// Elements without a framework: one function that makes them, and a few that format numbers.

type Child = Node | string | null | undefined | false;
type Attributes = Record<string, unknown>;

/** Makes an element. `on…` members are listeners, `class` and `data-…` attributes, everything else properties where they exist. */
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on") && typeof value === "function") element.addEventListener(name.slice(2), value as EventListener);
    else if (name in element && name !== "list" && name !== "form") (element as unknown as Attributes)[name] = value;
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.filter((child): child is Node | string => child !== null && child !== undefined && child !== false));
  return element;
}

/** A labelled form control in one line. */
export function field(label: string, control: HTMLElement, hint?: string): HTMLElement {
  // A label's text would otherwise include every option of a list.
  if (!control.hasAttribute("aria-label")) control.setAttribute("aria-label", label);
  return h("label", { class: "field", title: hint }, h("span", {}, label), control);
}

/** A list to choose from. */
export function choice(options: [value: string, text: string][], value: string, change: (value: string) => void, label?: string): HTMLSelectElement {
  const select = h("select", { "aria-label": label, onchange: () => change(select.value) }, ...options.map(([key, text]) => h("option", { value: key }, text)));
  select.value = value;
  return select;
}

/** Replaces what an element holds. A control that has the focus leaves it to its successor of the same name. */
export function refill(parent: HTMLElement, ...children: (Node | string)[]) {
  const focused = document.activeElement;
  const name = focused && parent.contains(focused) ? focused.getAttribute("aria-label") : null;
  parent.replaceChildren(...children);
  if (name !== null) parent.querySelector<HTMLElement>(`[aria-label="${CSS.escape(name)}"]`)?.focus();
}

/** A slider with its value written beside it. */
export function slider(
  label: string,
  range: { min: number; max: number; step: number; value: number },
  input: (value: number) => void,
  format: (value: number) => string = (value) => String(value),
  hint?: string,
): { element: HTMLElement; control: HTMLInputElement; set: (value: number) => void } {
  const output = h("output", {}, format(range.value));
  const control = h("input", { type: "range", "aria-label": label, min: String(range.min), max: String(range.max), step: String(range.step) });
  if (hint) control.setAttribute("aria-description", hint);
  control.value = String(range.value);
  control.addEventListener("input", () => {
    output.textContent = format(control.valueAsNumber);
    input(control.valueAsNumber);
  });
  const set = (value: number) => {
    control.value = String(value);
    output.textContent = format(control.valueAsNumber);
  };
  return { element: h("label", { class: "field slider", title: hint }, h("span", {}, label), control, output), control, set };
}

/** 134345 as 134,345. */
export const grouped = (value: number) => value.toLocaleString("en-GB");

/** `1 face`, `2 faces`. */
export const plural = (count: number, one: string, many = `${one}s`) => `${grouped(count)} ${count === 1 ? one : many}`;

/** A number with three digits that count. */
export function brief(value: number): string {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return Number(value.toPrecision(3)).toExponential().replace("e", " · 10^").replace("^+", "^").replace(/\^(-?\d+)/, (_, power: string) => superscript(power));
  return Number(value.toPrecision(3)).toLocaleString("en-GB", { maximumFractionDigits: 6 });
}

function superscript(digits: string): string {
  return digits.replace(/[-\d]/g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)]));
}

/** A power of ten: 0.01, 10⁻⁴. */
export const power = (exponent: number) => (exponent >= -2 && exponent <= 3 ? brief(10 ** exponent) : `10${superscript(String(exponent))}`);

/** Bytes with a unit. */
export function bytes(count: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  // What would be rounded to a thousand is one of the next.
  while (count >= 999.5 && unit < units.length - 1) {
    count /= 1000;
    unit += 1;
  }
  return `${unit === 0 ? count : count < 1000 ? count.toPrecision(3) : grouped(Math.round(count))} ${units[unit]}`;
}

/** `0.42 s`, `3 min`. */
export function seconds(value: number): string {
  if (value < 59.95) return `${value < 9.995 ? value.toFixed(2) : value.toFixed(1)} s`;
  const whole = Math.round(value);
  return whole < 3600 ? `${Math.floor(whole / 60)} min ${whole % 60} s` : `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/** Words of an identifier: `non_manifold_edge` as `non-manifold edge`. */
export const words = (name: string) => name.replaceAll("_", " ").replace(/\bnon /, "non-");
