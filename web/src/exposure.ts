// Where a processor draws: pictures are made out of sight, and shown once they are whole.

import { BufferAttribute, BufferGeometry, GLSL3, Mesh, ShaderMaterial, SRGBColorSpace, WebGLRenderTarget, type Camera, type Scene, type WebGLRenderer } from "three";

/** Triangles of a part of the fine picture. */
const PART = 50_000;

/** Whether a processor does the work of a graphics card. Smooth edges then come from more pixels, and only once nothing moves. */
export function drawnInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const software = !!context && !!names && /swiftshader|llvmpipe|software/i.test(String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)));
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return software;
}

/** A triangle over the whole window with a picture on it. */
export function exposure(): Mesh<BufferGeometry, ShaderMaterial> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
  const mesh = new Mesh(geometry, new ShaderMaterial({
    glslVersion: GLSL3, depthTest: false, depthWrite: false, uniforms: { picture: { value: null } },
    vertexShader: "void main() { gl_Position = vec4(position, 1.0); }",
    fragmentShader: "precision highp float; uniform sampler2D picture; out vec4 colour; void main() { colour = texture(picture, gl_FragCoord.xy / vec2(textureSize(picture, 0) / 2)); }",
  }));
  mesh.frustumCulled = false;
  return mesh;
}

interface Picture {
  renderer: WebGLRenderer;
  scene: Scene;
  camera: Camera;
  geometry: BufferGeometry;
  /** How many corners its triangles have. */
  corners: number;
  /** Pixels of the screen. */
  width: number;
  height: number;
  /** Called before each part; false where the picture is of no use any more. */
  begin: () => boolean;
  done: (target: WebGLRenderTarget) => void;
}

/**
 * Draws the fine picture out of sight, a part of the mesh at a time, and hands it over once it is whole. A browser that draws in software
 * keeps the page waiting until what is shown is drawn, and a million triangles take it half a second.
 */
export function develop({ renderer, scene, camera, geometry, corners, width, height, begin, done }: Picture) {
  const gl = renderer.getContext() as WebGL2RenderingContext;
  // Twice as many pixels each way as there are: from their means come smooth edges.
  const target = new WebGLRenderTarget(Math.max(2 * Math.floor(width), 2), Math.max(2 * Math.floor(height), 2));
  // Colours are written as on the screen, not as light.
  target.texture.colorSpace = SRGBColorSpace;
  (target as { isXRRenderTarget?: boolean }).isXRRenderTarget = true;
  let from = 0;
  const part = () => {
    if (!begin()) return target.dispose();
    if (from > 0 && from >= corners) {
      done(target);
      target.dispose();
      return;
    }
    geometry.setDrawRange(from, 3 * PART);
    renderer.setRenderTarget(target);
    renderer.autoClear = from === 0;
    renderer.render(scene, camera);
    renderer.autoClear = true;
    renderer.setRenderTarget(null);
    geometry.setDrawRange(0, Infinity);
    from += 3 * PART;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => {
      if (fence && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return void window.setTimeout(look, 15);
      gl.deleteSync(fence);
      part();
    };
    window.setTimeout(look, 5);
  };
  part();
}
