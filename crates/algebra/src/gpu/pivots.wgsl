// How the rows of the trees of a patch are eliminated, for each sigma, by a group of threads: level by level, the leaves first. Each row gets a share, which
// of what it has its parent is given, and an inverse pivot; `grounds` holds what it is grounded by.
struct Shape { first: u32, width: u32, sigmas: u32 }
var<immediate> s: Shape;
// For each patch where its levels begin; `levels` has one number more than there are levels in a patch.
@group(0) @binding(0) var<storage, read> patches: array<u32>;
// Where the nodes of each level begin, and where those of the last one end; roots are the first level.
@group(0) @binding(1) var<storage, read> levels: array<u32>;
// The row of a node, where its children begin and end, and the bits of the weight of the edge to its parent.
@group(0) @binding(2) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> weights: array<vec2<{T}>>;
@group(0) @binding(4) var<storage, read> bases: array<{T}>;
@group(0) @binding(5) var<storage, read_write> grounds: array<{T}>;
@group(0) @binding(6) var<storage, read_write> pivots: array<vec2<{T}>>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let own_patch = s.first + wg.x;
  let group = t % s.sigmas;
  let base = bases[group];
  let top = patches[own_patch];
  for (var level = patches[own_patch + 1u] - 1u; level > top; level--) {
    for (var at = levels[level - 1u] + t / s.sigmas; at < levels[level]; at += {THREADS}u / s.sigmas) {
      let node = nodes[at];
      let weight = {T}(bitcast<f32>(node.w));
      var ground = base / weights[node.x].x;
      for (var child = node.y; child < node.z; child++) {
        ground += pivots[child * s.sigmas + group].x * grounds[child * s.sigmas + group];
      }
      let inverse = {T}(1) / (ground + weight);
      grounds[at * s.sigmas + group] = ground;
      pivots[at * s.sigmas + group] = vec2<{T}>(weight * inverse, base * inverse);
    }
    storageBarrier();
  }
}
