// The sum of `parts` blocks of `count` numbers that lie behind each other: C = beta C + the sum.
struct Shape { parts: u32, count: u32, n: u32, c_at: u32, c_pitch: u32, first: u32, beta: f32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> a: array<{T}>;
@group(0) @binding(1) var<storage, read_write> c: array<{T}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let i = s.first + wg.x * {THREADS}u + t;
  if (i >= s.count) { return; }
  var sum = {T}(0);
  for (var part = 0u; part < s.parts; part++) { sum += a[part * s.count + i]; }
  let place = s.c_at + (i / s.n) * s.c_pitch + i % s.n;
  if (s.beta != 0.0) { sum += {T}(s.beta) * c[place]; }
  c[place] = sum;
}
