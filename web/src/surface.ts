// Triangle meshes as plain arrays: normals, rays, and the nearest corner.

export interface Surface {
  positions: Float32Array;
  triangles: Uint32Array;
}

/** Area-weighted normals of the vertices. */
export function normals({ positions, triangles }: Surface, out = new Float32Array(positions.length)): Float32Array {
  out.fill(0);
  if (triangles.length === 0) return outward(positions, out);
  // Areas are squares of lengths: of a surface 10^±20 in size they are no numbers of single precision, in whatever unit but its own.
  let most = 0;
  for (let i = 0; i < positions.length; i++) most = Math.max(most, Math.abs(positions[i] - positions[i % 3]));
  const unit = 1 / (most * most || 1);
  for (let f = 0; f < triangles.length; f += 3) {
    const a = 3 * triangles[f], b = 3 * triangles[f + 1], c = 3 * triangles[f + 2];
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
    const nx = unit * (uy * vz - uz * vy), ny = unit * (uz * vx - ux * vz), nz = unit * (ux * vy - uy * vx);
    out[a] += nx; out[a + 1] += ny; out[a + 2] += nz;
    out[b] += nx; out[b + 1] += ny; out[b + 2] += nz;
    out[c] += nx; out[c + 1] += ny; out[c + 2] += nz;
  }
  return normalised(out);
}

function normalised(out: Float32Array): Float32Array {
  for (let v = 0; v < out.length; v += 3) {
    // Math.hypot guards against overflow and is ten times slower.
    const length = Math.sqrt(out[v] * out[v] + out[v + 1] * out[v + 1] + out[v + 2] * out[v + 2]) || 1;
    out[v] /= length; out[v + 1] /= length; out[v + 2] /= length;
  }
  return out;
}

/** Directions away from the middle: points without faces are lit as if they lay on a ball. */
function outward(positions: Float32Array, out: Float32Array): Float32Array {
  const { centre, radius } = bounds({ positions, triangles: new Uint32Array(0) });
  for (let i = 0; i < positions.length; i++) out[i] = (positions[i] - centre[i % 3]) / radius;
  return normalised(out);
}

/** Neighbours of a vertex among which one is looked for one by one. */
const FEW = 24;

/** The two ends of every edge, once each. */
export function edges({ positions, triangles: t }: Surface): Uint32Array {
  // By their smaller ends, which have few each: a set of a million edges takes seconds.
  const places = new Uint32Array(positions.length / 3 + 2);
  const next = (i: number) => t[i % 3 === 2 ? i - 2 : i + 1];
  for (let i = 0; i < t.length; i++) places[Math.min(t[i], next(i)) + 2] += 1;
  for (let v = 2; v < places.length; v++) places[v] += places[v - 1];
  const others = new Uint32Array(t.length);
  for (let i = 0; i < t.length; i++) others[places[Math.min(t[i], next(i)) + 1]++] = Math.max(t[i], next(i));
  const ends = new Uint32Array(2 * t.length);
  let at = 0;
  for (let v = 0; v + 2 < places.length; v++) {
    const own = others.subarray(places[v], places[v + 1]);
    if (own.length > FEW) own.sort();
    for (let k = 0; k < own.length; k++) {
      // Sorted ones have their like beside them.
      let known = own.length > FEW ? k - 1 : 0;
      while (known >= 0 && known < k && own[known] !== own[k]) known += 1;
      if (known >= 0 && known < k) continue;
      [ends[at], ends[at + 1]] = [v, own[k]];
      at += 2;
    }
  }
  return ends.slice(0, at);
}

/** The gradient of a function over the surface at its vertices: that of the linear function on each face, averaged by area. */
export function gradient({ positions: p, triangles: t }: Surface, values: Float32Array, out = new Float32Array(p.length)): Float32Array {
  const area = new Float32Array(values.length);
  out.fill(0);
  for (let f = 0; f < t.length; f += 3) {
    const i = t[f], j = t[f + 1], k = t[f + 2];
    const a = 3 * i, b = 3 * j, c = 3 * k;
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const uu = ux * ux + uy * uy + uz * uz, uv = ux * vx + uy * vy + uz * vz, vv = vx * vx + vy * vy + vz * vz;
    const square = uu * vv - uv * uv;
    if (!(square > 0)) continue;
    const du = values[j] - values[i], dv = values[k] - values[i];
    // Twice the area times the gradient: its coordinates in the two edges come from their Gram matrix.
    const double = Math.sqrt(square);
    const s = (vv * du - uv * dv) / double, r = (uu * dv - uv * du) / double;
    const x = s * ux + r * vx, y = s * uy + r * vy, z = s * uz + r * vz;
    out[a] += x; out[a + 1] += y; out[a + 2] += z;
    out[b] += x; out[b + 1] += y; out[b + 2] += z;
    out[c] += x; out[c + 1] += y; out[c + 2] += z;
    area[i] += double; area[j] += double; area[k] += double;
  }
  for (let v = 0; v < area.length; v++) {
    const scale = area[v] > 0 ? 1 / area[v] : 0;
    out[3 * v] *= scale; out[3 * v + 1] *= scale; out[3 * v + 2] *= scale;
  }
  return out;
}

/** The centre of the bounding box, and the radius around it that holds every vertex. */
export function bounds({ positions }: Surface): { centre: [number, number, number]; radius: number } {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    for (let k = 0; k < 3; k++) {
      const x = positions[i + k];
      if (x < low[k]) low[k] = x;
      if (x > high[k]) high[k] = x;
    }
  }
  const centre = [0, 1, 2].map((k) => (low[k] + high[k]) / 2) as [number, number, number];
  let most = 0;
  for (let i = 0; i < positions.length; i += 3) {
    const x = positions[i] - centre[0], y = positions[i + 1] - centre[1], z = positions[i + 2] - centre[2];
    most = Math.max(most, x * x + y * y + z * z);
  }
  return { centre, radius: Math.sqrt(most) || 1 };
}

/** Six times the volume that a closed surface encloses; below zero where its triangles face inwards. */
export function volume({ positions: p, triangles: t }: Surface): number {
  let sum = 0;
  for (let f = 0; f < t.length; f += 3) {
    const a = 3 * t[f], b = 3 * t[f + 1], c = 3 * t[f + 2];
    sum += p[a] * (p[b + 1] * p[c + 2] - p[b + 2] * p[c + 1]) + p[a + 1] * (p[b + 2] * p[c] - p[b] * p[c + 2]) + p[a + 2] * (p[b] * p[c + 1] - p[b + 1] * p[c]);
  }
  return sum;
}

export interface Hit {
  /** −1 at a point without faces. */
  face: number;
  vertex: number;
  point: [number, number, number];
  distance: number;
}

/**
 * Where a ray first meets the surface (Möller and Trumbore 1997). A plain loop: 20 ms for a million faces, nothing to keep. Of a plane, four
 * numbers, only the side on which they are positive is met.
 */
export function cast({ positions, triangles }: Surface, origin: number[], ray: number[], plane?: number[]): Hit | null {
  const [ox, oy, oz] = origin, [dx, dy, dz] = ray;
  let nearest = Infinity, face = -1, bestU = 0, bestV = 0;
  for (let f = 0; f < triangles.length; f += 3) {
    const a = 3 * triangles[f], b = 3 * triangles[f + 1], c = 3 * triangles[f + 2];
    const ax = positions[a], ay = positions[a + 1], az = positions[a + 2];
    const ux = positions[b] - ax, uy = positions[b + 1] - ay, uz = positions[b + 2] - az;
    const vx = positions[c] - ax, vy = positions[c + 1] - ay, vz = positions[c + 2] - az;
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx;
    const determinant = ux * px + uy * py + uz * pz;
    if (determinant === 0) continue;
    const tx = ox - ax, ty = oy - ay, tz = oz - az;
    const u = (tx * px + ty * py + tz * pz) / determinant;
    if (u < 0 || u > 1) continue;
    const qx = ty * uz - tz * uy, qy = tz * ux - tx * uz, qz = tx * uy - ty * ux;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (v < 0 || u + v > 1) continue;
    const t = (vx * qx + vy * qy + vz * qz) / determinant;
    if (t > 0 && t < nearest) {
      if (plane && plane[0] * (ox + t * dx) + plane[1] * (oy + t * dy) + plane[2] * (oz + t * dz) + plane[3] < 0) continue;
      nearest = t;
      face = f / 3;
      bestU = u;
      bestV = v;
    }
  }
  if (face < 0) return null;
  const weights = [1 - bestU - bestV, bestU, bestV];
  const corner = weights.indexOf(Math.max(...weights));
  return {
    face,
    vertex: triangles[3 * face + corner],
    point: [ox + nearest * dx, oy + nearest * dy, oz + nearest * dz],
    distance: nearest,
  };
}

/** The first of the points without faces that a ray passes within `reach`. */
export function graze({ positions: p }: Surface, origin: number[], ray: number[], reach: number, plane?: number[]): Hit | null {
  let [nearest, vertex] = [Infinity, -1];
  for (let i = 0; i < p.length; i += 3) {
    const x = p[i] - origin[0], y = p[i + 1] - origin[1], z = p[i + 2] - origin[2];
    const along = x * ray[0] + y * ray[1] + z * ray[2];
    if (along <= 0 || along >= nearest || x * x + y * y + z * z - along * along > reach * reach) continue;
    if (plane && plane[0] * p[i] + plane[1] * p[i + 1] + plane[2] * p[i + 2] + plane[3] < 0) continue;
    [nearest, vertex] = [along, i / 3];
  }
  return vertex < 0 ? null : { face: -1, vertex, point: [p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2]], distance: nearest };
}

/** The surface with its up axis as y, which viewers of glTF expect. */
export function turned({ positions: p, triangles }: Surface, axes: [axis: number, sign: number][]): Surface {
  const positions = new Float32Array(p.length);
  for (let i = 0; i < p.length; i += 3) for (let k = 0; k < 3; k++) positions[i + k] = axes[k][1] * p[i + axes[k][0]];
  return { positions, triangles };
}
