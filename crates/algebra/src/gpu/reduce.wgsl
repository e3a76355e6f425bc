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
