// Spectral compression: the surface from a few rounded coefficients, and what they take.

import { numbers, send, type Basis } from "../api";
import type { App } from "../app";
import { brief, bytes, grouped, h, slider } from "../dom";
import { fileName, give } from "../give";
import { latest } from "../latest";
import type { components } from "../openapi";

type Rates = components["schemas"]["CompressionAnswer"];

interface Wish {
  basis: Basis;
  pairs: number;
  bits: number;
}

export interface Compression {
  element: HTMLElement;
  /** Shows the surface as it comes back. */
  apply(): void;
  pairs: { control: HTMLInputElement; set: (value: number) => void };
  bits: { control: HTMLInputElement; set: (value: number) => void };
}

/** `here` tells whether what comes back is still wanted; `changed` hears that something was moved. */
export function compression(app: App, here: (basis: Basis) => boolean, changed: () => void): Compression {
  const facts = h("dl", { class: "facts-list" });
  const note = h("p", { class: "dim" });
  let packed: ArrayBuffer | null = null;
  const save = h("button", { disabled: true, onclick: () => packed && give(new Blob([packed]), `${fileName(app.mesh?.name ?? "mesh", "compressed")}.bin`) }, "Save the bytes");
  const ask = latest<Wish>(async ({ basis, pairs, bits }) => {
    const begin = performance.now();
    const request = (accept: string): RequestInit => ({ method: "POST", body: JSON.stringify({ functions: "coordinates", pairs, bits }), headers: { "Content-Type": "application/json", Accept: accept } });
    const to = basis.links.self;
    const binary = await (await send(`${to}/compress`, request("application/octet-stream"))).arrayBuffer();
    const positions = await numbers(`${to}/decompress`, { method: "POST", body: binary, headers: { "Content-Type": "application/octet-stream" } });
    // Last, so that it is the request that is kept.
    const rates = (await (await send(`${to}/compress`, request("application/json"))).json()) as Rates;
    if (!here(basis)) return;
    packed = binary;
    save.disabled = false;
    app.viewer.setPositions(positions);
    const percent = (errors: number[]) => errors.map((error) => `${brief(100 * error)} %`).join(" · ");
    const rows: [string, string, string][] = [
      ["Size", bytes(rates.bytes), `${grouped(rates.nonzeros)} coefficients that are not zero`],
      ["Per vertex", `${brief(rates.bits_per_vertex)} bits`, "All three coordinates together"],
      ["With the basis", rates.basis_from_faces ? "the same" : `${brief(rates.bits_per_vertex_with_basis)} bits`, rates.basis_from_faces ? "Whoever has the faces computes the basis anew" : `Whoever decompresses needs the basis, ${bytes(rates.basis_bytes)}`],
      ["Error", percent(rates.relative_errors), "Of x, y and z, relative to how far the surface is from its mean"],
      ["Truncation", percent(rates.truncation_errors), "What leaving out the other modes costs without any rounding"],
    ];
    facts.replaceChildren(...rows.map(([name, value, title]) => h("div", { title }, h("dt", {}, name), h("dd", {}, value))));
    note.textContent = `${brief(performance.now() - begin)} ms there and back`;
    document.body.dataset.compressed = `${pairs} ${bits} ${rates.bytes}`;
  }, app.fail);
  let of: Basis | null = null;
  const apply = () => {
    // Bytes and figures of another surface are not shown under the name of this one.
    if (of !== app.basis) {
      [of, packed] = [app.basis, null];
      save.disabled = true;
      facts.replaceChildren();
      note.textContent = "";
    }
    if (app.basis) ask({ basis: app.basis, pairs: Math.min(pairs.control.valueAsNumber, app.basis.count), bits: bits.control.valueAsNumber });
  };
  const move = () => {
    changed();
    apply();
  };
  const pairs = slider("Modes kept", { min: 1, max: 100, step: 1, value: 100 }, move, grouped);
  const bits = slider("Bits", { min: 2, max: 24, step: 1, value: 12 }, move);
  const element = h("div", {}, h("p", {}, "The coordinates in the first modes, rounded and packed; what you see is what comes back."), pairs.element, bits.element, facts, h("div", { class: "row" }, save), note,
    h("p", { class: "dim" }, h("a", { href: "docs/guide/compression", target: "_blank" }, "How it works")));
  facts.classList.add("wide");
  return { element, apply, pairs, bits };
}
