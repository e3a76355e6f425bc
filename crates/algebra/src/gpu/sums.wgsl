// What kernels have in common that sum up rows column by column. A group sums up its rows; sum `v` of group `g` for column `k` lies at
// (v * parts + g) * width + k.
struct Shape { first: u32, end: u32, width: u32, groups: u32, part: u32, parts: u32, exact: u32 }
var<immediate> s: Shape;
@group(0) @binding(0) var<storage, read> starts: array<u32>;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<{T}>;
@group(0) @binding(3) var<storage, read> mass_starts: array<u32>;
@group(0) @binding(4) var<storage, read> mass_columns: array<u32>;
@group(0) @binding(5) var<storage, read> mass_values: array<{T}>;
// One over the lumped mass of each row, and the weight of its rounding errors.
@group(0) @binding(6) var<storage, read> weights: array<vec2<{T}>>;
@group(0) @binding(7) var<storage, read_write> sums: array<{T}>;
var<workgroup> shared_sums: array<{T}, {THREADS}>;

const SUM = 0u;
const LEAST = 1u;
const GREATEST = 2u;

// One number from each thread of a group, together for each column.
fn reduce(group: u32, t: u32, v: u32, value: {T}, how: u32) {
  workgroupBarrier();
  shared_sums[t] = value;
  workgroupBarrier();
  for (var half = {THREADS}u / s.width / 2u; half > 0u; half /= 2u) {
    if (t < half * s.width) {
      let other = shared_sums[t + half * s.width];
      let own = shared_sums[t];
      if (how == SUM) { shared_sums[t] = own + other; }
      if (how == LEAST && other < own) { shared_sums[t] = other; }
      if (how == GREATEST && other > own) { shared_sums[t] = other; }
    }
    workgroupBarrier();
  }
  if (t < s.width) { sums[(v * s.parts + s.part + group) * s.width + t] = shared_sums[t]; }
}
