// Eigenfields of the Hodge–Laplacian among the modes: needles on the faces, and how long they are as colours.

import { numbers, type Basis, type BasisSummary } from "../api";
import type { App } from "../app";
import { h, plural, words } from "../dom";
import { Glyphs, spread } from "../lines";
import type { Surface } from "../surface";
import { sequential, type Look } from "./look";

type Part = "harmonic" | "gradient" | "co_gradient";

/** Needles on the screen. */
const GLYPHS = 2600;
/** Neither dark nor yellow, as the ends of the colour maps are. */
const INK = 0xff4f87;

/** Whether the modes of a basis are fields. */
export const ofFields = (basis: BasisSummary | null) => basis?.kind === "eigenbasis" && basis.parameters.operator === "hodge";

/** Vectors in space from two numbers for each face, in its frame. */
export function lifted(pairs: Float32Array, frames: Float32Array): Float32Array {
  const vectors = new Float32Array((3 * pairs.length) / 2);
  for (let f = 0; 2 * f < pairs.length; f++) {
    const [a, b] = [pairs[2 * f], pairs[2 * f + 1]];
    for (let k = 0; k < 3; k++) vectors[3 * f + k] = a * frames[6 * f + k] + b * frames[6 * f + 3 + k];
  }
  return vectors;
}

/** How long a field is, at the vertices: the mean over the faces around each. Of more than three numbers for a face the first three count. */
export function lengths(vectors: Float32Array, { positions, triangles: t }: Surface, wide = 3): Float32Array {
  const sums = new Float32Array(positions.length / 3), counts = new Float32Array(positions.length / 3);
  for (let i = 0; i < t.length; i++) {
    const f = Math.floor(i / 3);
    sums[t[i]] += Math.hypot(vectors[wide * f], vectors[wide * f + 1], vectors[wide * f + 2]);
    counts[t[i]] += 1;
  }
  return sums.map((sum, v) => sum / Math.max(counts[v], 1));
}

export class HodgeModes {
  readonly element = h("div", { hidden: true });
  private frames: { mesh: string; values: Float32Array } | null = null;
  private glyphs: Glyphs | null = null;

  constructor(private readonly app: App, private readonly look: Look, private readonly go: (mode: number) => void) {}

  /** What part of the decomposition each mode is. */
  private parts(basis: Basis): Part[] {
    return basis.kind === "eigenbasis" && "hodge" in basis.operator ? (basis.operator.hodge.parts as Part[]) : [];
  }

  /** What a mode is, in a word. */
  part(basis: Basis, mode: number): string {
    return this.parts(basis)[mode]?.replace("_", "-") ?? "";
  }

  /** Buttons that lead to the next mode of each part. */
  offer(basis: Basis, mode: () => number) {
    this.element.hidden = !ofFields(basis);
    if (this.element.hidden) return;
    const parts = this.parts(basis);
    const buttons = (["harmonic", "gradient", "co_gradient"] as const).map((part) => {
      const count = parts.filter((other) => other === part).length;
      return h("button", { disabled: count === 0, title: `Go to the next ${words(part).replace(" ", "-")} field`, onclick: () => {
        const at = mode();
        const after = parts.findIndex((other, k) => k > at && other === part);
        this.go(after < 0 ? parts.indexOf(part) : after);
      } }, plural(count, part === "harmonic" ? "harmonic field" : part.replace("_", "-")));
    });
    this.element.replaceChildren(h("p", { class: "dim" }, "Fields, in their parts: harmonic ones go around handles and holes, gradients come from a function, co-gradients are gradients turned by 90°."), h("div", { class: "row wrap" }, ...buttons));
  }

  /** Draws a mode. */
  async show(basis: Basis, pairs: Float32Array, wanted: () => boolean) {
    const surface = this.app.viewer.surface;
    const { mesh } = basis;
    if (!surface || mesh === null) return;
    if (this.frames?.mesh !== mesh) this.frames = { mesh, values: await numbers(`/v1/meshes/${mesh}/frames`) };
    if (!wanted()) return;
    const vectors = lifted(pairs, this.frames.values);
    this.look.show(sequential(lengths(vectors, surface), 0.995));
    if (!this.glyphs) {
      this.glyphs = new Glyphs(surface, spread(surface, GLYPHS), { kind: "arrows" }, 0.006 * this.app.viewer.radius, INK);
      this.app.viewer.overlay("glyphs", this.glyphs.object);
    }
    this.glyphs.set(vectors);
    this.app.kept.field = { values: vectors, columns: 3 };
    this.app.viewer.draw();
  }

  hide() {
    this.glyphs = null;
    this.app.kept.field = null;
    this.app.viewer.overlay("glyphs", null);
  }
}
