// One column of the blocked reduction of a symmetric matrix to tridiagonal form, in three steps (LAPACK's dlatrd: Dongarra, Sorensen and
// Hammarling 1989). The matrix A stays as it was before the block; V and W, one vector per row, hold what is to be subtracted from it:
// A - V'W - W'V. The work space holds, behind each other: the column x (d), A v (d), the raw second vector (d), products of V and W with v (2 nb),
// partial sums of |x|^2 and of w.v, the diagonal (d), the off-diagonal (d), and the factors tau (d).
struct Step {
  d: u32,            // the order of A
  j: u32,            // the column
  l: u32,            // its place within the block
  nb: u32,           // vectors of V in the buffer; W lies behind them
  first_row: u32,    // the first row of A in the buffer
  rows: u32,         // rows of A in the buffer
  parts: u32,        // room for partial sums
  groups: u32,       // partial sums in use
  flush: u32,        // only finish the last vector of W
  dot_groups: u32,   // groups that multiply V and W with v
}
var<immediate> s: Step;
@group(0) @binding(0) var<storage, read> a: array<{T}>;
@group(0) @binding(1) var<storage, read_write> vw: array<{T}>;
@group(0) @binding(2) var<storage, read_write> work: array<{T}>;
var<workgroup> sums: array<{T}, {THREADS}>;

fn at_product() -> u32 { return s.d; }
fn at_raw() -> u32 { return 2u * s.d; }
fn at_dots() -> u32 { return 3u * s.d; }
fn at_norms() -> u32 { return 3u * s.d + 2u * s.nb; }
fn at_parts() -> u32 { return at_norms() + s.parts; }
fn at_diagonal() -> u32 { return at_norms() + 2u * s.parts; }
fn at_off_diagonal() -> u32 { return at_diagonal() + s.d; }
fn at_tau() -> u32 { return at_off_diagonal() + s.d; }

// The sum of one number from each thread of a group of `threads`, a power of two.
fn sum_of(t: u32, threads: u32, value: {T}) -> {T} {
  workgroupBarrier();
  sums[t] = value;
  workgroupBarrier();
  for (var half = threads / 2u; half > 0u; half /= 2u) {
    if (t < half) { sums[t] += sums[t + half]; }
    workgroupBarrier();
  }
  return sums[0];
}

// The sum of partial sums from the step before.
fn total(t: u32, threads: u32, at: u32) -> {T} {
  var part = {T}(0);
  for (var i = t; i < s.groups; i += threads) { part += work[at + i]; }
  return sum_of(t, threads, part);
}

// The square root of a number above zero: the hardware has it in f32 only, and two Newton steps double its digits twice.
fn root(square: {T}) -> {T} {
  var x = square;
  var scale = {T}(1);
  for (var i = 0u; i < 26u; i++) {
    if (x >= {T}(1e-15)) { break; }
    x *= {T}(1099511627776.0);
    scale *= {T}(0.00000095367431640625);
  }
  for (var i = 0u; i < 26u; i++) {
    if (x <= {T}(1e15)) { break; }
    x *= {T}(0.00000000000090949470177292823791503906250);
    scale *= {T}(1048576.0);
  }
  var r = {T}(sqrt(f32(x)));
  r = {T}(0.5) * (r + x / r);
  r = {T}(0.5) * (r + x / r);
  return r * scale;
}

// Finishes w of the step before, and takes column j of A - V'W - W'V.
@compute @workgroup_size({THREADS})
fn column(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  var half = {T}(0);
  if (s.l > 0u) { half = {T}(0.5) * work[at_tau() + s.j - 1u] * total(t, {THREADS}u, at_parts()); }
  let i = s.j + wg.x * {THREADS}u + t;
  var square = {T}(0);
  if (i < s.d) {
    var x = {T}(0);
    if (s.flush == 0u) { x = a[(s.j - s.first_row) * s.d + i]; }
    if (s.l > 0u) {
      let last = s.l - 1u;
      let v_i = vw[last * s.d + i];
      let v_j = vw[last * s.d + s.j];
      let w_i = work[at_raw() + i] - half * v_i;
      let w_j = work[at_raw() + s.j] - half * v_j;
      vw[(s.nb + last) * s.d + i] = w_i;
      if (s.flush == 0u) {
        for (var q = 0u; q < last; q++) {
          x -= vw[q * s.d + i] * vw[(s.nb + q) * s.d + s.j] + vw[(s.nb + q) * s.d + i] * vw[q * s.d + s.j];
        }
        x -= v_i * w_j + w_i * v_j;
      }
    }
    if (s.flush == 0u) {
      work[i] = x;
      if (i == s.j) { work[at_diagonal() + i] = x; }
      if (i > s.j + 1u) { square = x * x; }
    }
  }
  if (s.flush == 0u) {
    let sum = sum_of(t, {THREADS}u, square);
    if (t == 0u) { work[at_norms() + wg.x] = sum; }
  }
}

// Makes the reflector of column j, and multiplies A, V and W with it.
@compute @workgroup_size({ROW_THREADS})
fn reflector(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let first = s.j + 1u;
  let square = total(t, {ROW_THREADS}u, at_norms());
  let alpha = work[first];
  var beta = alpha;
  var tau = {T}(0);
  var scale = {T}(0);
  if (square > {TINY}) {
    beta = root(alpha * alpha + square);
    if (alpha > {T}(0)) { beta = -beta; }
    tau = (beta - alpha) / beta;
    scale = {T}(1) / (alpha - beta);
  }
  let top = max(first, s.first_row);
  let dots = wg.x < s.dot_groups;
  var row = wg.x * 4u;
  if (!dots) { row = top + (wg.x - s.dot_groups) * 4u; }
  let row_end = s.first_row + s.rows;
  var sum_0 = {T}(0);
  var sum_1 = {T}(0);
  var sum_2 = {T}(0);
  var sum_3 = {T}(0);
  if (dots) {
    // Row q of these is row q of V, then row q - l of W.
    let last = 2u * s.l - 1u;
    let q_0 = min(row, last);
    let q_1 = min(row + 1u, last);
    let q_2 = min(row + 2u, last);
    let q_3 = min(row + 3u, last);
    let at_0 = select(q_0, q_0 - s.l + s.nb, q_0 >= s.l) * s.d;
    let at_1 = select(q_1, q_1 - s.l + s.nb, q_1 >= s.l) * s.d;
    let at_2 = select(q_2, q_2 - s.l + s.nb, q_2 >= s.l) * s.d;
    let at_3 = select(q_3, q_3 - s.l + s.nb, q_3 >= s.l) * s.d;
    for (var c = first + t; c < s.d; c += {ROW_THREADS}u) {
      var v = work[c] * scale;
      if (c == first) { v = {T}(1); }
      sum_0 += vw[at_0 + c] * v;
      sum_1 += vw[at_1 + c] * v;
      sum_2 += vw[at_2 + c] * v;
      sum_3 += vw[at_3 + c] * v;
    }
  } else {
    let last = row_end - 1u;
    let at_0 = (min(row, last) - s.first_row) * s.d;
    let at_1 = (min(row + 1u, last) - s.first_row) * s.d;
    let at_2 = (min(row + 2u, last) - s.first_row) * s.d;
    let at_3 = (min(row + 3u, last) - s.first_row) * s.d;
    for (var c = first + t; c < s.d; c += {ROW_THREADS}u) {
      var v = work[c] * scale;
      if (c == first) { v = {T}(1); }
      sum_0 += a[at_0 + c] * v;
      sum_1 += a[at_1 + c] * v;
      sum_2 += a[at_2 + c] * v;
      sum_3 += a[at_3 + c] * v;
    }
  }
  sum_0 = sum_of(t, {ROW_THREADS}u, sum_0);
  sum_1 = sum_of(t, {ROW_THREADS}u, sum_1);
  sum_2 = sum_of(t, {ROW_THREADS}u, sum_2);
  sum_3 = sum_of(t, {ROW_THREADS}u, sum_3);
  if (t < 4u) {
    var sum = sum_0;
    if (t == 1u) { sum = sum_1; }
    if (t == 2u) { sum = sum_2; }
    if (t == 3u) { sum = sum_3; }
    let q = row + t;
    if (dots) {
      if (q < 2u * s.l) { work[at_dots() + q] = sum; }
    } else if (q < row_end) {
      work[at_product() + q] = sum;
      var v = work[q] * scale;
      if (q == first) { v = {T}(1); }
      vw[s.l * s.d + q] = v;
    }
  }
  // The group of the first row also keeps the numbers of this column, and clears v above it.
  if (!dots && row == first) {
    if (t == 0u) {
      work[at_off_diagonal() + s.j] = beta;
      work[at_tau() + s.j] = tau;
    }
    for (var c = t; c < first; c += {ROW_THREADS}u) { vw[s.l * s.d + c] = {T}(0); }
  }
}

// The raw second vector: tau (A v - V'(W v) - W'(V v)), and its product with v.
@compute @workgroup_size({THREADS})
fn combine(@builtin(workgroup_id) wg: vec3<u32>, @builtin(local_invocation_index) t: u32) {
  let i = s.j + 1u + wg.x * {THREADS}u + t;
  var along = {T}(0);
  if (i < s.d) {
    var w = work[at_product() + i];
    for (var q = 0u; q < s.l; q++) {
      w -= vw[q * s.d + i] * work[at_dots() + s.l + q] + vw[(s.nb + q) * s.d + i] * work[at_dots() + q];
    }
    w *= work[at_tau() + s.j];
    work[at_raw() + i] = w;
    along = w * vw[s.l * s.d + i];
  }
  let sum = sum_of(t, {THREADS}u, along);
  if (t == 0u) { work[at_parts() + wg.x] = sum; }
}
