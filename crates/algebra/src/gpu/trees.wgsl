// What is left of residuals, gathered from the leaves of the trees of each patch to their roots by a group of threads, and for each column the sum of the
// squares over the pivots.
struct Shape { first: u32, width: u32, sigmas: u32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> patches: array<u32>;
@group(0) @binding(1) var<storage, read> levels: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> pivots: array<vec2<{T}>>;
@group(0) @binding(4) var<storage, read_write> left: array<{T}>;
@group(0) @binding(5) var<storage, read_write> sums: array<{T}>;
var<workgroup> shared_sums: array<{T}, {THREADS}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let own_patch = s.first + wg.x;
  let at_once = {THREADS}u / s.width;
  let column = t % s.width;
  let group = column / (s.width / s.sigmas);
  let top = patches[own_patch];
  var excess = {T}(0);
  for (var level = patches[own_patch + 1u] - 1u; level > top; level--) {
    for (var at = levels[level - 1u] + t / s.width; at < levels[level]; at += at_once) {
      let node = nodes[at];
      let place = node.x * s.width + column;
      var sum = left[place];
      for (var child = node.y; child < node.z; child++) {
        sum += pivots[child * s.sigmas + group].x * left[nodes[child].x * s.width + column];
      }
      left[place] = sum;
      excess += sum * sum * pivots[at * s.sigmas + group].y;
    }
    storageBarrier();
  }
  shared_sums[t] = excess;
  workgroupBarrier();
  for (var half = at_once / 2u; half > 0u; half /= 2u) {
    if (t < half * s.width) { shared_sums[t] += shared_sums[t + half * s.width]; }
    workgroupBarrier();
  }
  if (t < s.width) { sums[own_patch * s.width + t] = shared_sums[t]; }
}
