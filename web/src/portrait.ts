// Small pictures of surfaces, for lists.

import { BufferAttribute, BufferGeometry, Color, Matrix4, Mesh, PerspectiveCamera, Scene, WebGLRenderTarget, type WebGLRenderer } from "three";
import { meshContent, type Mesh as Stored } from "./api";
import { cloud } from "./cloud";
import { prepared, type Prepared } from "./geometry";
import { h } from "./dom";
import { Shading } from "./shading";
import { AXES } from "./upright";
import type { Viewer } from "./viewer";

/** Pixels of a picture each way, and how many times as many are drawn. */
const SIZE = 56;
const FINER = 2;
/** Larger meshes are not fetched for a picture. */
const LARGEST = 300_000;

/** Draws a surface out of sight. */
export function portrait(renderer: WebGLRenderer, surface: Prepared): ImageData {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(surface.positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(surface.normals, 3));
  geometry.setIndex(new BufferAttribute(surface.levels[surface.levels.length - 1], 1));
  const shading = new Shading();
  const mesh = surface.triangles.length ? new Mesh(geometry, shading.fine) : cloud(geometry.setIndex(null), shading);
  mesh.frustumCulled = false;
  const rows = AXES[surface.up].map(([axis, sign]) => [0, 1, 2].map((k) => (k === axis ? sign : 0)));
  const [a, b, c] = rows;
  mesh.matrixAutoUpdate = false;
  mesh.matrix.set(a[0], a[1], a[2], 0, b[0], b[1], b[2], 0, c[0], c[1], c[2], 0, 0, 0, 0, 1)
    .multiply(new Matrix4().makeScale(1 / surface.radius, 1 / surface.radius, 1 / surface.radius))
    .multiply(new Matrix4().makeTranslation(-surface.centre[0], -surface.centre[1], -surface.centre[2]));
  const scene = new Scene().add(mesh);
  const camera = new PerspectiveCamera(32, 1, 0.01, 100);
  camera.position.set(0.9, 0.55, 3.6);
  camera.lookAt(0, 0, 0);
  const wide = SIZE * FINER;
  const target = new WebGLRenderTarget(wide, wide, { samples: 4 });
  const [colour, alpha, planes] = [renderer.getClearColor(new Color()), renderer.getClearAlpha(), renderer.clippingPlanes];
  renderer.clippingPlanes = [];
  renderer.setClearColor(0, 0);
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const bytes = new Uint8Array(4 * wide * wide);
  renderer.readRenderTargetPixels(target, 0, 0, wide, wide, bytes);
  renderer.setRenderTarget(null);
  renderer.setClearColor(colour, alpha);
  renderer.clippingPlanes = planes;
  target.dispose();
  geometry.dispose();
  shading.dispose();
  // Rows of WebGL go upwards.
  const picture = new ImageData(wide, wide);
  for (let row = 0; row < wide; row++) picture.data.set(bytes.subarray(4 * wide * (wide - 1 - row), 4 * wide * (wide - row)), 4 * wide * row);
  return picture;
}

/** Pictures of stored meshes, each drawn once, one after the other, as they come into sight. */
export class Portraits {
  private readonly known = new Map<string, ImageData | null>();
  private queue: Promise<unknown> = Promise.resolve();
  private readonly wanted = new WeakMap<Element, string>();
  private readonly seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) continue;
      this.seen.unobserve(target);
      this.queue = this.queue.then(() => this.draw(target as HTMLCanvasElement));
    }
  });

  constructor(private readonly viewer: Viewer, private readonly find: (id: string) => Promise<Stored>) {}

  /** A canvas on which the mesh appears. */
  of(id: string): HTMLCanvasElement {
    const canvas = h("canvas", { class: "portrait", width: SIZE * FINER, height: SIZE * FINER, "aria-hidden": "true" });
    this.wanted.set(canvas, id);
    this.seen.observe(canvas);
    return canvas;
  }

  private async draw(canvas: HTMLCanvasElement) {
    const id = this.wanted.get(canvas)!;
    if (!this.known.has(id) && canvas.isConnected) {
      try {
        const mesh = await this.find(id);
        this.known.set(id, mesh.vertices > LARGEST ? null : this.viewer.portrait(await prepared(await meshContent(mesh.links.content, () => {}))));
      } catch {
        // One that was deleted meanwhile has no picture; the list says so by itself when it is made anew.
        this.known.set(id, null);
      }
    }
    const picture = this.known.get(id);
    if (!picture) return;
    canvas.getContext("2d")!.putImageData(picture, 0, 0);
    canvas.dataset.drawn = "true";
  }
}
