// The first minute: surfaces to begin with, one click away from a swinging mode.

import { get, send, upload } from "./api";
import type { App } from "./app";
import { h } from "./dom";

interface Sample {
  name: string;
  description: string;
}

/** Those that are offered first, with how many vertices and which mode they begin. */
const FIRST: Record<string, { vertices: number; mode: number }> = {
  bell: { vertices: 8_000, mode: 12 }, violin: { vertices: 6_000, mode: 14 }, starfish: { vertices: 9_000, mode: 11 },
};
const OTHERS = { vertices: 8_000, mode: 9 };
const PAIRS = 100;

/** Fetches a generated mesh, uploads it as a file of one's own, and has its modes computed. */
export async function begin(app: App, name: string) {
  const { vertices, mode } = FIRST[name] ?? OTHERS;
  const file = await (await send(`/v1/samples/${name}?vertices=${vertices}`)).blob();
  const mesh = await upload(new File([file], `${name}.ply`), () => {});
  await app.list();
  await app.open(mesh.id);
  app.go({ mode });
  app.tab("modes");
  app.swinging = true;
  await app.submit("eigenbasis", { count: PAIRS });
}

/** Buttons that begin with a generated surface. */
export function samples(app: App): HTMLElement {
  const list = h("div", { class: "samples" });
  const button = ({ name, description }: Sample) => {
    const made = h("button", { title: description, onclick: () => {
      for (const other of list.querySelectorAll("button")) other.disabled = true;
      begin(app, name).catch(app.fail).finally(() => {
        for (const other of list.querySelectorAll("button")) other.disabled = false;
      });
    } }, name);
    return made;
  };
  // Once meshes can be listed, samples can: before, a key may be missing.
  app.on("meshes", () => {
    if (list.childElementCount > 0) return;
    get<{ items: Sample[] }>("/v1/samples").then(({ items }) => list.replaceChildren(...items.map(button))).catch(app.fail);
  });
  return list;
}

/** What an empty page says. */
export function welcome(app: App): HTMLElement {
  const element = h("div", { class: "welcome", hidden: true },
    h("h2", {}, "The eigenfunctions of any surface"),
    h("p", {}, "Drop a mesh anywhere on this page, or begin with one of these:"), samples(app),
    h("p", {}, h("a", { href: "docs/guide/tutorial", target: "_blank" }, "A tutorial of ten minutes")));
  for (const happening of ["mesh", "meshes"] as const) app.on(happening, () => (element.hidden = app.mesh !== null || app.meshes.length > 0 || app.sought !== ""));
  return element;
}
