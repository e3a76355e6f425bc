// What is shown, as files: surfaces, values, correspondences. All of it is made in the browser from what is on the screen.

import { BufferAttribute, BufferGeometry, Mesh, MeshStandardMaterial } from "three";
import { GLTFExporter } from "three/examples/jsm/exporters/GLTFExporter.js";
import { normals, turned, type Surface } from "./surface";
import { Lines, shortest } from "./text";

/** A function at the vertices, with the colours in which it is shown: three bytes a vertex. */
export interface Coloured {
  values: Float32Array;
  colours: Uint8Array;
}

/** A field on the faces, so many numbers for each: a vector, or the two of a tensor. */
export interface FaceField {
  values: Float32Array;
  columns: number;
}

export function obj({ positions: p, triangles: t }: Surface): Blob {
  const lines = new Lines();
  for (let v = 0; v < p.length; v += 3) lines.add(`v ${shortest(p[v])} ${shortest(p[v + 1])} ${shortest(p[v + 2])}`);
  for (let f = 0; f < t.length; f += 3) lines.add(`f ${t[f] + 1} ${t[f + 1] + 1} ${t[f + 2] + 1}`);
  return lines.blob("model/obj");
}

/** Binary PLY; with colours, and the values themselves as the property `value`, where there are any. */
export function ply({ positions: p, triangles: t }: Surface, shown: Coloured | null): Blob {
  const vertices = p.length / 3, faces = t.length / 3;
  const header = ["ply", "format binary_little_endian 1.0", `element vertex ${vertices}`, "property float x", "property float y", "property float z",
    ...(shown ? ["property uchar red", "property uchar green", "property uchar blue", "property float value"] : []),
    `element face ${faces}`, "property list uchar uint vertex_indices", "end_header", ""].join("\n");
  const wide = shown ? 19 : 12;
  const data = new DataView(new ArrayBuffer(wide * vertices + 13 * faces));
  for (let v = 0, at = 0; v < vertices; v++, at += wide) {
    for (let k = 0; k < 3; k++) data.setFloat32(at + 4 * k, p[3 * v + k], true);
    if (!shown) continue;
    for (let k = 0; k < 3; k++) data.setUint8(at + 12 + k, shown.colours[3 * v + k]);
    data.setFloat32(at + 15, shown.values[v], true);
  }
  for (let f = 0, at = wide * vertices; f < faces; f++, at += 13) {
    data.setUint8(at, 3);
    for (let k = 0; k < 3; k++) data.setUint32(at + 1 + 4 * k, t[3 * f + k], true);
  }
  return new Blob([header, data], { type: "model/ply" });
}

/** PolyData of VTK, as ParaView and PyVista read it. */
export function vtp({ positions: p, triangles: t }: Surface, shown: Coloured | null, field?: FaceField): Blob {
  const vertices = p.length / 3, faces = t.length / 3;
  const lines = new Lines();
  lines.add('<?xml version="1.0"?>');
  lines.add('<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData>');
  lines.add(`<Piece NumberOfPoints="${vertices}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="${faces}">`);
  if (shown) {
    lines.add(`<PointData Scalars="value"><DataArray type="Float32" Name="value" format="ascii">`);
    for (const value of shown.values) lines.add(shortest(value));
    lines.add("</DataArray></PointData>");
  }
  if (field) {
    // Of a tensor its eigendirections times their eigenvalues: two vectors.
    const parts = field.columns / 3;
    lines.add("<CellData>");
    for (let part = 0; part < parts; part++) {
      lines.add(`<DataArray type="Float32" Name="${parts === 1 ? "field" : `field_${part + 1}`}" NumberOfComponents="3" format="ascii">`);
      for (let at = 3 * part; at < field.values.length; at += field.columns) lines.add(Array.from(field.values.subarray(at, at + 3), shortest).join(" "));
      lines.add("</DataArray>");
    }
    lines.add("</CellData>");
  }
  lines.add('<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">');
  for (let v = 0; v < p.length; v += 3) lines.add(`${shortest(p[v])} ${shortest(p[v + 1])} ${shortest(p[v + 2])}`);
  lines.add('</DataArray></Points><Polys><DataArray type="Int64" Name="connectivity" format="ascii">');
  for (let f = 0; f < t.length; f += 3) lines.add(`${t[f]} ${t[f + 1]} ${t[f + 2]}`);
  lines.add('</DataArray><DataArray type="Int64" Name="offsets" format="ascii">');
  for (let f = 1; f <= faces; f++) lines.add(String(3 * f));
  lines.add("</DataArray></Polys></Piece></PolyData></VTKFile>");
  return lines.blob("application/xml");
}

/** Binary glTF, of a surface with y up. */
export async function glb(surface: Surface, shown: Coloured | null): Promise<Blob> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(surface.positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals(surface), 3));
  // Colours of glTF are linear light.
  if (shown) geometry.setAttribute("color", new BufferAttribute(Float32Array.from(shown.colours, (byte) => LIGHT[byte]), 3));
  geometry.setIndex(new BufferAttribute(surface.triangles, 1));
  const material = new MeshStandardMaterial({ vertexColors: shown !== null, metalness: 0, roughness: 0.7 });
  const bytes = await new GLTFExporter().parseAsync(new Mesh(geometry, material), { binary: true });
  geometry.dispose();
  material.dispose();
  return new Blob([bytes as ArrayBuffer], { type: "model/gltf-binary" });
}

const linear = (value: number) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const LIGHT = Float32Array.from({ length: 256 }, (_, byte) => linear(byte / 255));

/** A row for each vertex: number, position, value. */
export function csv({ positions: p }: Surface, shown: Coloured, vertex: string): Blob {
  const lines = new Lines();
  lines.add(`${vertex},x,y,z,value`);
  shown.values.forEach((value, v) => lines.add([String(v), ...[p[3 * v], p[3 * v + 1], p[3 * v + 2], value].map(shortest)].join(",")));
  return lines.blob("text/csv");
}

/** Numbers as an array of NumPy; with `columns`, as rows of so many. */
export function npy(values: Float32Array | Int32Array, columns?: number): Blob {
  const shape = columns ? `${values.length / columns}, ${columns}` : `${values.length},`;
  const text = `{'descr': '${values instanceof Int32Array ? "<i4" : "<f4"}', 'fortran_order': False, 'shape': (${shape}), }`;
  // Magic, version and length of the header; the data begin at a multiple of 64.
  const padded = `${text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11)}\n`;
  const head = new Uint8Array([0x93, ...new TextEncoder().encode("NUMPY"), 1, 0, padded.length & 255, padded.length >> 8]);
  return new Blob([head, padded, values as Float32Array<ArrayBuffer>], { type: "application/octet-stream" });
}

/** A correspondence: for each vertex of the target that of the source, or nothing where it is below zero, and how sure that is. */
export function pairs(points: Int32Array, confidences: Float32Array, numbering: string): Blob {
  const lines = new Lines();
  lines.add(`target_${numbering},source_${numbering},confidence`);
  points.forEach((point, v) => lines.add(`${v},${point < 0 ? "" : point},${Number.isNaN(confidences[v]) ? "" : shortest(confidences[v])}`));
  return lines.blob("text/csv");
}

/** What is asked of the thread that writes files. */
export type Order =
  | { kind: "obj"; surface: Surface }
  | { kind: "ply"; surface: Surface; shown: Coloured | null }
  | { kind: "vtp"; surface: Surface; shown: Coloured | null; field?: FaceField }
  | { kind: "glb"; surface: Surface; shown: Coloured | null; axes: [axis: number, sign: number][] }
  | { kind: "csv"; surface: Surface; shown: Coloured; vertex: string }
  | { kind: "npy"; values: Float32Array | Int32Array; columns?: number }
  | { kind: "pairs"; points: Int32Array; confidences: Float32Array; numbering: string };

/** Writes a file. */
export async function written(order: Order): Promise<Blob> {
  switch (order.kind) {
    case "obj": return obj(order.surface);
    case "ply": return ply(order.surface, order.shown);
    case "vtp": return vtp(order.surface, order.shown, order.field);
    case "glb": return glb(turned(order.surface, order.axes), order.shown);
    case "csv": return csv(order.surface, order.shown, order.vertex);
    case "npy": return npy(order.values, order.columns);
    case "pairs": return pairs(order.points, order.confidences, order.numbering);
  }
}
