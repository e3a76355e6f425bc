// Numbered points on a surface.

import { CanvasTexture, Group, Mesh, MeshBasicMaterial, SphereGeometry, Sprite, SpriteMaterial, SRGBColorSpace } from "three";
import type { Viewer } from "./viewer";

/** Colours that stay apart for every common deficiency of colour vision (Okabe and Ito 2008), dark enough for white digits. */
export const COLOURS = ["#0072b2", "#b34700", "#007a5a", "#a3447a", "#5a4a00", "#1b4f72", "#7b1fa2", "#8c2d04"];

export const colourOf = (index: number) => COLOURS[index % COLOURS.length];

const textures = new Map<string, CanvasTexture>();

/** A disc with a number. */
function disc(text: string, colour: string): CanvasTexture {
  const known = textures.get(text + colour);
  if (known) return known;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const c = canvas.getContext("2d")!;
  c.fillStyle = colour;
  c.strokeStyle = "#ffffff";
  c.lineWidth = 5;
  c.beginPath();
  c.arc(32, 32, 28, 0, 7);
  c.fill();
  c.stroke();
  c.fillStyle = "#ffffff";
  c.font = `bold ${text.length > 1 ? 28 : 36}px system-ui, sans-serif`;
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.fillText(text, 32, 34);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  textures.set(text + colour, texture);
  return texture;
}

/** Shows vertices with their numbers, a little above the surface. */
export function showPins(viewer: Viewer, pins: { vertex: number; text: string; colour: string }[]) {
  const p = viewer.surface?.positions;
  if (!p || pins.length === 0) return viewer.overlay("pins", null);
  const group = new Group();
  for (const { vertex, text, colour } of pins) {
    const at = [p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2]] as const;
    const normal = viewer.normalAt(vertex) ?? [0, 0, 0];
    const dot = new Mesh(new SphereGeometry(0.014 * viewer.radius, 12, 8), new MeshBasicMaterial({ color: colour }));
    dot.position.set(...at);
    const label = new Sprite(new SpriteMaterial({ map: disc(text, colour) }));
    label.position.set(at[0] + 0.055 * viewer.radius * normal[0], at[1] + 0.055 * viewer.radius * normal[1], at[2] + 0.055 * viewer.radius * normal[2]);
    label.scale.setScalar(0.09 * viewer.radius);
    group.add(dot, label);
  }
  viewer.overlay("pins", group);
}
