// r = S x - theta M x for a panel of columns, both matrices in compressed rows, and for each column the sums that its bounds are made of.
{SUMS}
@group(0) @binding(8) var<storage, read> thetas: array<{T}>;
@group(0) @binding(9) var<storage, read> x: array<{T}>;
@group(0) @binding(10) var<storage, read_write> right: array<f32>;

@compute @workgroup_size({THREADS})
fn main(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let column = t % s.width;
  let theta = thetas[column];
  let step = s.groups * ({THREADS}u / s.width);
  var residual = {T}(0); var dual = {T}(0); var stiffness = {T}(0); var square = {T}(0); var mass = {T}(0); var energy = {T}(0);
  var rounding = {T}(0); var lowest = {T}(0); var highest = {T}(0);
  for (var row = s.first + wg.x * ({THREADS}u / s.width) + t / s.width; row < s.end; row += step) {
    let own = x[row * s.width + column];
    var sx = {T}(0);
    for (var k = starts[row]; k < starts[row + 1u]; k++) { sx += values[k] * x[columns[k] * s.width + column]; }
    var mx = {T}(0);
    for (var k = mass_starts[row]; k < mass_starts[row + 1u]; k++) {
      mx += mass_values[k] * x[mass_columns[k] * s.width + column];
    }
    let r = sx - theta * mx;
    right[row * s.width + column] = f32(r);
    let w = weights[row];
    residual += r * r;
    dual += r * r * w.x;
    stiffness += sx * sx;
    square += own * own;
    mass += own * mx;
    energy += own * sx;
    rounding += w.y * own * own;
    if (own < lowest) { lowest = own; }
    if (own > highest) { highest = own; }
  }
  reduce(wg.x, t, 0u, residual, SUM);
  reduce(wg.x, t, 1u, dual, SUM);
  reduce(wg.x, t, 2u, stiffness, SUM);
  reduce(wg.x, t, 3u, square, SUM);
  reduce(wg.x, t, 4u, mass, SUM);
  reduce(wg.x, t, 5u, energy, SUM);
  reduce(wg.x, t, 6u, rounding, SUM);
  reduce(wg.x, t, 7u, lowest, LEAST);
  reduce(wg.x, t, 8u, highest, GREATEST);
}
