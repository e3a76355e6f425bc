// One pass over panels of right-hand sides with A = S + (c + sigma) M: S in compressed rows, M diagonal, sigma a number for each column. Threads
// side by side read a line of a panel.
struct Pass { end: u32, width: u32, first: u32, kind: u32, floor: f32, beta: f32, gamma: f32 }
var<immediate> s: Pass;
@group(0) @binding(0) var<storage, read> starts: array<u32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<{T}>;
// The absolute sum of each row, and its mass.
@group(0) @binding(3) var<storage, read> diagonal: array<vec2<{T}>>;
@group(0) @binding(4) var<storage, read> sigmas: array<{T}>;
@group(0) @binding(5) var<storage, read> right: array<{T}>;
@group(0) @binding(6) var<storage, read> x: array<{T}>;
@group(0) @binding(7) var<storage, read_write> result: array<{T}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  // The width is a power of two, and divides the number of threads.
  let row = s.first + wg.x * ({THREADS}u / s.width) + t / s.width;
  if (row >= s.end) { return; }
  let column = t % s.width;
  let place = row * s.width + column;
  if (s.kind == {ADD}u) {
    result[place] += x[place];
    return;
  }
  let sigma = sigmas[column];
  let d = diagonal[row];
  let size = d.x + sigma * d.y;
  var scale = {T}(0);
  if (size > {T}(0)) { scale = {T}(s.gamma) / size; }
  if (s.kind == {SCALE}u) {
    result[place] = scale * right[place];
    return;
  }
  let own = x[place];
  var image = (sigma + {T}(s.floor)) * d.y * own;
  for (var k = starts[row]; k < starts[row + 1u]; k++) { image += values[k] * x[columns[k] * s.width + column]; }
  let rest = right[place] - image;
  if (s.kind == {REST}u) {
    result[place] = rest;
    return;
  }
  var kept = {T}(1.0 + s.beta) * own;
  if (s.kind == {STEP}u) { kept -= {T}(s.beta) * result[place]; }
  result[place] = scale * rest + kept;
}
