// How the rows of the trees of a patch are eliminated, for each sigma: row r of patch p has a share and an inverse pivot. The second number of a pivot is what
// its row is grounded by until the row's turn comes.
struct Shape { first: u32, end: u32, sigmas: u32 }
var<immediate> s: Shape;
// The first row of each patch, and the end.
@group(0) @binding(0) var<storage, read> patches: array<u32>;
// Row, parent and the bits of the weight between them, in the order of elimination; numbered within the patch.
@group(0) @binding(1) var<storage, read> nodes: array<u32>;
@group(0) @binding(2) var<storage, read> weights: array<vec2<{T}>>;
@group(0) @binding(3) var<storage, read> bases: array<{T}>;
@group(0) @binding(4) var<storage, read_write> pivots: array<vec2<{T}>>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let at = wg.x * {THREADS}u + t;
  let own_patch = s.first + at / s.sigmas;
  let group = at % s.sigmas;
  if (own_patch >= s.end) { return; }
  let base = bases[group];
  let start = patches[own_patch];
  let end = patches[own_patch + 1u];
  for (var row = start; row < end; row++) { pivots[row * s.sigmas + group] = vec2<{T}>({T}(0), base / weights[row].x); }
  for (var k = start; k < end; k++) {
    let own = (start + nodes[3u * k]) * s.sigmas + group;
    let parent = (start + nodes[3u * k + 1u]) * s.sigmas + group;
    let weight = {T}(bitcast<f32>(nodes[3u * k + 2u]));
    let ground = pivots[own].y;
    let inverse = {T}(1) / (ground + weight);
    let share = weight * inverse;
    pivots[own] = vec2<{T}>(share, base * inverse);
    // A root hangs on itself, by a weight of zero.
    if (parent != own) { pivots[parent].y += share * ground; }
  }
}
