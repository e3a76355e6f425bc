// What is left of residuals, gathered from the leaves of the trees of each patch to their roots, and for each column the sum of the squares over the pivots.
struct Shape { first: u32, end: u32, width: u32, sigmas: u32, part: u32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> patches: array<u32>;
@group(0) @binding(1) var<storage, read> nodes: array<u32>;
@group(0) @binding(2) var<storage, read> pivots: array<vec2<{T}>>;
@group(0) @binding(3) var<storage, read_write> left: array<{T}>;
@group(0) @binding(4) var<storage, read_write> sums: array<{T}>;
var<workgroup> shared_sums: array<{T}, {THREADS}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let at_once = {THREADS}u / s.width;
  let own_patch = s.first + wg.x * at_once + t / s.width;
  let column = t % s.width;
  let group = column / (s.width / s.sigmas);
  var excess = {T}(0);
  if (own_patch < s.end) {
    let start = patches[own_patch];
    let end = patches[own_patch + 1u];
    for (var k = start; k < end; k++) {
      let row = start + nodes[3u * k];
      let parent = start + nodes[3u * k + 1u];
      let pivot = pivots[row * s.sigmas + group];
      let sum = left[row * s.width + column];
      excess += sum * sum * pivot.y;
      if (parent != row) { left[parent * s.width + column] += pivot.x * sum; }
    }
  }
  shared_sums[t] = excess;
  workgroupBarrier();
  for (var half = at_once / 2u; half > 0u; half /= 2u) {
    if (t < half * s.width) { shared_sums[t] += shared_sums[t + half * s.width]; }
    workgroupBarrier();
  }
  if (t < s.width) { sums[(s.part + wg.x) * s.width + t] = shared_sums[t]; }
}
