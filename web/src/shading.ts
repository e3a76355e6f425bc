// How the surface is lit and coloured: one pair of shaders, in two qualities.

import { BackSide, Color, DataTexture, DoubleSide, FrontSide, GLSL3, NearestFilter, RGBAFormat, ShaderMaterial, Vector2, type Side } from "three";
import { MAPS, table } from "./colours";

// Where the surface waves along its normals by w f, its normals become n − w ∇f, but for what its curvature adds.
const VERTEX = `
in float value;
in vec3 slope;
uniform float wave;
uniform float dot_size;
out float v_value;
#ifdef TINT
in vec3 tint;
out vec3 v_tint;
#endif
#include <clipping_planes_pars_vertex>
#ifdef QUICK
out vec2 v_light;
#else
out vec3 v_normal;
out vec3 v_position;
#endif
LIGHT
void main() {
  vec4 at = modelViewMatrix * vec4(position + wave * value * normal, 1.0);
  // The matrix is as large as the surface is in its own unit, and the square of that may be no number: only its direction counts.
  vec3 n = normalMatrix / max(max(abs(normalMatrix[0].x), abs(normalMatrix[0].y)), abs(normalMatrix[0].z)) * (normal - wave * slope);
  v_value = value;
#ifdef TINT
  v_tint = tint;
#endif
  vec4 mvPosition = at;
  #include <clipping_planes_vertex>
#ifdef QUICK
  v_light = light(normalize(n), normalize(-at.xyz));
#else
  v_normal = n;
  v_position = at.xyz;
#endif
  gl_Position = projectionMatrix * at;
  gl_PointSize = max(dot_size * projectionMatrix[1][1] / gl_Position.w, 2.0);
}`;

/** Edges lie a little before their triangles. */
const EDGES = `
in float value;
uniform float wave;
#include <clipping_planes_pars_vertex>
void main() {
  vec4 mvPosition = modelViewMatrix * vec4(position + wave * value * normal, 1.0);
  #include <clipping_planes_vertex>
  gl_Position = projectionMatrix * mvPosition;
  gl_Position.z -= 2e-4 * gl_Position.w;
}`;

const EDGE = `
precision highp float;
#include <clipping_planes_pars_fragment>
out vec4 colour;
void main() {
  #include <clipping_planes_fragment>
  colour = vec4(0.10, 0.12, 0.16, 1.0);
}`;

/** What falls on the surface, and what it mirrors. The far side of an open surface is lit as the near one. */
const LIGHT = `
vec2 light(vec3 n, vec3 eye) {
  float head = dot(n, eye);
  if (head < 0.0) { n = -n; head = -head; }
  float key = max(dot(n, vec3(0.36, 0.56, 0.74)), 0.0);
  float shine = max(dot(reflect(vec3(-0.36, -0.56, -0.74), n), eye), 0.0);
  return vec2(0.42 + 0.08 * n.y + 0.26 * head + 0.36 * key, 0.10 * pow(shine, 24.0));
}`;

// Isolines are as wide on the screen as on paper, however steep the function: their distance is measured in its own derivative.
const FRAGMENT = `
precision highp float;
precision highp sampler2D;
in float v_value;
#ifdef QUICK
in vec2 v_light;
#else
in vec3 v_normal;
in vec3 v_position;
#endif
uniform sampler2D map;
uniform vec2 range;
uniform float lines;
uniform float coloured;
uniform float diverging;
uniform vec3 plain;
#ifdef TINT
in vec3 v_tint;
uniform float checks;
#endif
#include <clipping_planes_pars_fragment>
out vec4 colour;
LIGHT
void main() {
  #include <clipping_planes_fragment>
  vec3 base = plain;
#ifdef TINT
  base = mix(vec3(0.12), vec3(0.97), v_tint);
  if (checks > 0.5) {
    vec3 cell = floor(v_tint * checks);
    base = mix(base, vec3(0.08), 0.75 * mod(cell.x + cell.y + cell.z, 2.0));
  }
#endif
  if (coloured > 0.5) {
    float part = (v_value - range.x) * range.y;
    float t = clamp(part, 0.0, 1.0);
    vec3 shown = texelFetch(map, ivec2(int(t * 1023.0 + 0.5), 0), 0).rgb;
    if (lines > 0.5) {
      float s = t * lines;
      float w = max(fwidth(s), 1e-9);
      float d = abs(fract(s - 0.5) - 0.5) / w;
      float ink = clamp(1.47 - 1.33 * d, 0.0, 1.0) * clamp(1.64 - 1.82 * w, 0.0, 1.0);
      if (diverging > 0.5) ink = max(0.55 * ink, clamp(2.13 - 1.25 * abs(s - 0.5 * lines) / w, 0.0, 1.0));
      else ink *= 0.6;
      // Where nothing changes, as on a component that a mode does not reach, all would be line.
      ink *= clamp(2e4 * w - 0.1, 0.0, 1.0);
      // What lies beyond the range is a plateau: no line of any width runs there.
      if (part > 0.0 && part < 1.0) shown = mix(shown, vec3(0.06), ink);
    }
    // Where there is no value, as on a part of the surface that no way leads to, there is no colour either.
    if (abs(v_value) < 1e37) base = shown;
  }
#ifdef QUICK
  vec2 l = v_light;
#else
  vec2 l = light(normalize(v_normal), normalize(-v_position));
#endif
  colour = vec4(base * l.x + l.y, 1.0);
}`;

/** The colour of a surface without values, or where there is none: red, green, blue from 0 to 1. */
export const PLAIN = [0.8, 0.79, 0.76] as const;

/** Steps of a colour map: more than a screen shows, so that nothing is interpolated between them. */
const STEPS = 1024;

/**
 * The two materials of the surface. `fine` lights every pixel; `quick` lights the vertices, which costs a processor that does the
 * work of a graphics card a third less.
 */
export class Shading {
  readonly fine: ShaderMaterial;
  readonly quick: ShaderMaterial;
  /** Of the edges of the triangles, which move as the surface does. */
  readonly edges: ShaderMaterial;
  private readonly uniforms = {
    map: { value: null as DataTexture | null }, range: { value: new Vector2(-1, 0.5) }, lines: { value: 0 }, coloured: { value: 0 }, diverging: { value: 1 },
    plain: { value: new Color(...PLAIN) }, wave: { value: 0 }, checks: { value: 0 }, dot_size: { value: 0 },
  };
  private named = "";

  constructor() {
    const [vertexShader, fragmentShader] = [VERTEX, FRAGMENT];
    const make = (quick: boolean) => new ShaderMaterial({
      glslVersion: GLSL3, side: DoubleSide, uniforms: this.uniforms, clipping: true,
      vertexShader: vertexShader.replace("LIGHT", quick ? LIGHT : ""), fragmentShader: fragmentShader.replace("LIGHT", quick ? "" : LIGHT),
      defines: quick ? { QUICK: "" } : {},
    });
    [this.fine, this.quick] = [make(false), make(true)];
    this.edges = new ShaderMaterial({ glslVersion: GLSL3, uniforms: this.uniforms, clipping: true, vertexShader: EDGES, fragmentShader: EDGE });
  }

  private outer: Side = DoubleSide;

  /** Which sides of the triangles are drawn: of a closed surface only the outer one. */
  sides(closed: boolean, volume: number) {
    this.outer = closed ? (volume > 0 ? FrontSide : BackSide) : DoubleSide;
    this.opened(false);
  }

  /** Where a part is cut away, the inside is seen too. */
  opened(open: boolean) {
    this.fine.side = this.quick.side = open ? DoubleSide : this.outer;
  }

  /** Whether the surface has the colours of its attribute `tint`; above 0, `checks` lays so many dark cells over them along each axis. */
  tint(on: boolean, checks = 0) {
    this.uniforms.checks.value = checks;
    for (const material of [this.fine, this.quick]) {
      if (on === "TINT" in material.defines) continue;
      if (on) material.defines.TINT = "";
      else delete material.defines.TINT;
      material.needsUpdate = true;
    }
  }

  /** What the values at the vertices mean, or that there are none. */
  values(range: [number, number] | null, diverging = false) {
    this.uniforms.coloured.value = range ? 1 : 0;
    if (!range) return;
    this.uniforms.range.value.set(range[0], 1 / Math.max(range[1] - range[0], 1e-30));
    this.uniforms.diverging.value = diverging ? 1 : 0;
  }

  /** Chooses the colour map; false where it is there already. */
  map(name: string): boolean {
    if (name === this.named) return false;
    this.named = name;
    const texture = new DataTexture(table(MAPS[name] ?? MAPS["blue-orange"], STEPS), STEPS, 1, RGBAFormat);
    texture.minFilter = texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    this.uniforms.map.value?.dispose();
    this.uniforms.map.value = texture;
    return true;
  }

  dispose() {
    for (const material of [this.fine, this.quick, this.edges]) material.dispose();
    this.uniforms.map.value?.dispose();
  }

  /** How large points without faces are: in pixels, at a distance of one, with the field of view of the projection left out. */
  dots(size: number) {
    this.uniforms.dot_size.value = size;
  }

  lines(count: number) {
    this.uniforms.lines.value = count;
  }

  /** How far the surface moves along its normals, in units of the mesh per unit of its values. */
  wave(amount: number) {
    this.uniforms.wave.value = amount;
  }

  /** How far it is moved now. */
  get waving(): number {
    return this.uniforms.wave.value;
  }
}
