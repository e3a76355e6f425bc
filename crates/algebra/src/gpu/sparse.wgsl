// C = alpha S A + beta C for a sparse S in compressed rows and row-major A and C: a thread per entry of C, threads side by side read lines of A.
struct Shape { rows: u32, n: u32, a_pitch: u32, c_at: u32, c_pitch: u32, first: u32, across: u32, alpha: f32, beta: f32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> starts: array<u32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<{T}>;
@group(0) @binding(3) var<storage, read> a: array<{T}>;
@group(0) @binding(4) var<storage, read_write> c: array<{T}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  // `across` threads, a power of two, share a row.
  let row = s.first + wg.x * ({THREADS}u / s.across) + t / s.across;
  if (row >= s.rows) { return; }
  for (var column = t % s.across; column < s.n; column += s.across) {
    var sum = {T}(0);
    for (var k = starts[row]; k < starts[row + 1u]; k++) { sum += values[k] * a[columns[k] * s.a_pitch + column]; }
    sum = {T}(s.alpha) * sum;
    let place = s.c_at + row * s.c_pitch + column;
    if (s.beta != 0.0) { sum += {T}(s.beta) * c[place]; }
    c[place] = sum;
  }
}
