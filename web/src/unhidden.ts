// Lines on the surface as they are seen: only the parts that nothing hides.

import { Color, DoubleSide, GLSL3, ShaderMaterial, Vector3, WebGLRenderTarget, type BufferGeometry, type Mesh, type PerspectiveCamera, type Scene, type WebGLRenderer } from "three";

/** A point this far behind the surface, in its radius, is hidden by it. */
const HIDDEN = 0.01;
/** The largest number in three bytes. */
const DEEPEST = 16777215;

const VERTEX = `
#include <clipping_planes_pars_vertex>
void main() {
  vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
  #include <clipping_planes_vertex>
  gl_Position = projectionMatrix * mvPosition;
}`;
// Three bytes of depth: what a canvas gives back is bytes.
const FRAGMENT = `
precision highp float;
#include <clipping_planes_pars_fragment>
out vec4 bytes;
void main() {
  #include <clipping_planes_fragment>
  float d = floor(gl_FragCoord.z * ${DEEPEST}.0);
  bytes = vec4(floor(d / 65536.0), mod(floor(d / 256.0), 256.0), mod(d, 256.0), 255.0) / 255.0;
}`;

/** Runs of points in the window, of lines in the units of the mesh. The depth of the mesh, in a scene that shows nothing else, tells what is seen. */
export function unhidden(renderer: WebGLRenderer, scene: Scene, camera: PerspectiveCamera, mesh: Mesh<BufferGeometry>, lines: number[][][], width: number, height: number): [number, number][][] {
  const [columns, rows] = [Math.max(2 * width, 2), Math.max(2 * height, 2)];
  const target = new WebGLRenderTarget(columns, rows);
  const depth = new ShaderMaterial({ glslVersion: GLSL3, side: DoubleSide, clipping: true, vertexShader: VERTEX, fragmentShader: FRAGMENT });
  const [material, background] = [mesh.material, renderer.getClearColor(new Color())];
  mesh.material = depth;
  renderer.setClearColor(0xffffff, 1);
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const bytes = new Uint8Array(4 * columns * rows);
  renderer.readRenderTargetPixels(target, 0, 0, columns, rows, bytes);
  renderer.setRenderTarget(null);
  renderer.setClearColor(background, 1);
  mesh.material = material;
  target.dispose();
  depth.dispose();

  const { near, far } = camera;
  const away = (d: number) => (near * far) / (far - d * (far - near));
  const at = new Vector3();
  const place = (point: number[]): [number, number] | null => {
    at.set(point[0], point[1], point[2]).applyMatrix4(mesh.matrixWorld).project(camera);
    const [s, t] = [(at.x + 1) / 2, (at.y + 1) / 2];
    const [column, row] = [Math.floor(s * columns), Math.floor(t * rows)];
    if (column < 0 || row < 0 || column >= columns || row >= rows) return null;
    const i = 4 * (row * columns + column);
    const stored = (65536 * bytes[i] + 256 * bytes[i + 1] + bytes[i + 2]) / DEEPEST;
    return away((at.z + 1) / 2) < away(stored) + HIDDEN ? [s * width, (1 - t) * height] : null;
  };
  const runs: [number, number][][] = [];
  for (const line of lines) {
    let run: [number, number][] = [];
    for (const point of [...line, null]) {
      const seen = point && place(point);
      if (seen) run.push(seen);
      else {
        if (run.length > 1) runs.push(run);
        run = [];
      }
    }
  }
  return runs;
}
