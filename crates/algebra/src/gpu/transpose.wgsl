// C = transpose of A for parts of row-major matrices, both reading and writing whole lines.
struct Shape {
  m: u32, n: u32,
  a_at: u32, a_pitch: u32,
  c_at: u32, c_pitch: u32,
}
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> a: array<{T}>;
@group(0) @binding(1) var<storage, read_write> c: array<{T}>;
var<workgroup> tile: array<{T}, 272>;

@compute @workgroup_size({EDGE}, {EDGE})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_id) t: vec3<u32>) {
  let row = wg.y * {EDGE}u + t.y;
  let column = wg.x * {EDGE}u + t.x;
  if (row < s.m && column < s.n) { tile[t.y * 17u + t.x] = a[s.a_at + row * s.a_pitch + column]; }
  workgroupBarrier();
  let to_row = wg.x * {EDGE}u + t.y;
  let to_column = wg.y * {EDGE}u + t.x;
  if (to_row < s.n && to_column < s.m) { c[s.c_at + to_row * s.c_pitch + to_column] = tile[t.x * 17u + t.y]; }
}
