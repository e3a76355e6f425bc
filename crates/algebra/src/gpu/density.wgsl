// Adds to each row the weighted sum over its columns of y r.
struct Shape { first: u32, end: u32, width: u32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> weights: array<{T}>;
@group(0) @binding(1) var<storage, read> right: array<f32>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
@group(0) @binding(3) var<storage, read_write> density: array<{T}>;
var<workgroup> terms: array<{T}, {THREADS}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let row = s.first + wg.x * ({THREADS}u / s.width) + t / s.width;
  let column = t % s.width;
  var term = {T}(0);
  if (row < s.end) {
    let place = row * s.width + column;
    term = weights[column] * {T}(y[place]) * {T}(right[place]);
  }
  terms[t] = term;
  workgroupBarrier();
  for (var half = s.width / 2u; half > 0u; half /= 2u) {
    if (column < half) { terms[t] += terms[t + half]; }
    workgroupBarrier();
  }
  if (column == 0u && row < s.end) { density[row] += terms[t]; }
}
