// Points without faces: there are no triangles to draw, so each is a square of its own.

import { Points, type BufferGeometry } from "three";
import type { Shading } from "./shading";

/** The largest of them, in radii of the whole. */
const LARGEST = 0.05;

/** Points that are drawn as large as they are far apart, so that they cover most of what is between them. */
export function cloud(geometry: BufferGeometry, shading: Shading): Points<BufferGeometry> {
  const points = new Points<BufferGeometry>(geometry, shading.fine);
  points.frustumCulled = false;
  const size = Math.min(2 / Math.sqrt(Math.max(geometry.getAttribute("position").count, 1)), LARGEST);
  // A picture drawn out of sight has its own number of pixels.
  points.onBeforeRender = (renderer) => shading.dots((size * (renderer.getRenderTarget()?.height ?? renderer.domElement.height)) / 2);
  return points;
}
