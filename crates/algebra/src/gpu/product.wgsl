// C = alpha op(A) op(B) + beta C for parts of row-major matrices, tile by tile. With more than one group along z, group z sums its share of
// the terms into a matrix of its own, `c_part` numbers behind the one before.
struct Shape {
  m: u32, n: u32, k: u32,
  a_at: u32, a_pitch: u32,
  b_at: u32, b_pitch: u32,
  c_at: u32, c_pitch: u32,
  k_share: u32, c_part: u32,
  first_row: u32, first_column: u32,
  alpha: f32, beta: f32,
}
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> a: array<{T}>;
@group(0) @binding(1) var<storage, read> b: array<{T}>;
@group(0) @binding(2) var<storage, read_write> c: array<{T}>;
var<workgroup> tile_a: array<{T}, {SHARED_A}>;
var<workgroup> tile_b: array<{T}, {SHARED_B}>;

fn put(part: u32, row: u32, column: u32, value: {T}) {
  if (row < s.m && column < s.n) {
    let place = s.c_at + part * s.c_part + row * s.c_pitch + column;
    var sum = {T}(s.alpha) * value;
    // Not `beta * c`, which would keep a NaN of a buffer that was never written.
    if (s.beta != 0.0) { sum += {T}(s.beta) * c[place]; }
    c[place] = sum;
  }
}

@compute @workgroup_size({GROUP})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let first_row = s.first_row + wg.y * {ROWS}u;
  let first_column = s.first_column + wg.x * {COLUMNS}u;
  let across = t % {ACROSS}u;
  let down = t / {ACROSS}u;
{DECLARE}
  let end = min(s.k, (wg.z + 1u) * s.k_share);
  for (var low = wg.z * s.k_share; low < end; low += {DEPTH}u) {
    for (var i = t; i < {ROWS}u * {DEPTH}u; i += {GROUP}u) {
      {SPLIT_A}
      var value = {T}(0);
      if (first_row + r < s.m && low + k < end) { value = a[s.a_at + {PLACE_A}]; }
      tile_a[k * {PITCH_A}u + r] = value;
    }
    for (var i = t; i < {COLUMNS}u * {DEPTH}u; i += {GROUP}u) {
      {SPLIT_B}
      var value = {T}(0);
      if (first_column + r < s.n && low + k < end) { value = b[s.b_at + {PLACE_B}]; }
      tile_b[k * {PITCH_B}u + r] = value;
    }
    workgroupBarrier();
    for (var k = 0u; k < {DEPTH}u; k++) {
{MULTIPLY}
    }
    workgroupBarrier();
  }
{STORE}
}
