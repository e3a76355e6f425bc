// What is left of residuals r by y, r - S y - shift M y, and for each column the sums that enclose the norm of r.
{SUMS}
@group(0) @binding(8) var<storage, read> shifts: array<{T}>;
@group(0) @binding(9) var<storage, read> right: array<f32>;
@group(0) @binding(10) var<storage, read> y: array<f32>;
@group(0) @binding(11) var<storage, read_write> rest: array<f32>;
// The same in double precision, if `exact` is not 0.
@group(0) @binding(12) var<storage, read_write> left_exactly: array<{T}>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let column = t % s.width;
  let shift = shifts[column];
  let step = s.groups * ({THREADS}u / s.width);
  var below = {T}(0); var size = {T}(0); var excess = {T}(0); var rounding = {T}(0); var mass = {T}(0);
  for (var row = s.first + wg.x * ({THREADS}u / s.width) + t / s.width; row < s.end; row += step) {
    let place = row * s.width + column;
    let own = {T}(y[place]);
    let r = {T}(right[place]);
    var ay = {T}(0);
    for (var k = starts[row]; k < starts[row + 1u]; k++) { ay += values[k] * {T}(y[columns[k] * s.width + column]); }
    var my = {T}(0);
    for (var k = mass_starts[row]; k < mass_starts[row + 1u]; k++) {
      my += mass_values[k] * {T}(y[mass_columns[k] * s.width + column]);
    }
    let left = r - ay - shift * my;
    rest[place] = f32(left);
    if (s.exact != 0u) { left_exactly[place] = left; }
    let w = weights[row];
    below += own * (r + left);
    size += abs(own * r) + abs(own * left);
    excess += left * left * w.x;
    rounding += w.y * own * own;
    mass += own * my;
  }
  reduce(wg.x, t, 0u, below, SUM);
  reduce(wg.x, t, 1u, size, SUM);
  reduce(wg.x, t, 2u, excess, SUM);
  reduce(wg.x, t, 3u, rounding, SUM);
  reduce(wg.x, t, 4u, mass, SUM);
}
