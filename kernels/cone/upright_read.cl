/* Upright views to those of tilted detectors (include/cone/upright.h):
 *
 *     data[view][i][k] = sum over r, c of cubic(v - r) cubic(u - c) upright[view][r][c].
 *
 * With SLOPE 1 it is the derivative by u, with SLOPE 2 that by v. Pixels whose four rows and columns
 * are not all there are zero; with SPLINE 1, of four columns at least, those beside the upright view.
 * `first` is the first view of the run, `views` tells which view of the data each is. Index space:
 * (runs of LANES columns, rows of the tilted detector, views of the run).
 *
 * Buffers: data[along2, rows, bins], upright[along2, upright_rows, upright_bins],
 * forms[first + along2, VIEW_FORMS], views[first + along2]. */

#include "include/portable.h"
#include "include/lane_quads.h"
#include "include/cone/upright.h"

#ifndef SLOPE
#define SLOPE 0
#endif
#if SPLINE
#define BY_COLUMN(n) share(u, TO_FLOAT(c + (n)), upright_bins)
#define BY_ROW(n) share(v, TO_FLOAT(r + (n)), upright_rows)
#else
#define BY_COLUMN(n) (SLOPE == 1 ? keys_slope(x - (real)(n)) : keys(x - (real)(n)))
#define BY_ROW(n) (SLOPE == 2 ? keys_slope(y - (real)(n)) : keys(y - (real)(n)))
#endif

KERNEL void upright_read(
    __global real *restrict data, __global const real *restrict upright,
    __global const real *restrict forms, __global const int *restrict views, int first, int rows,
    int bins, int upright_rows, int upright_bins)
{
  const int k0 = (int)get_global_id(0) * LANES, i = (int)get_global_id(1);
  const int view = (int)get_global_id(2);
  if (k0 >= bins) return;
  lanes u, v, depth;
  const lanes k = (real)k0 + LANE_NUMBERS - (real)0.5f * (bins - 1);
  seen_at(
      forms + (long)(first + view) * VIEW_FORMS, k, (lanes)(i - (real)0.5f * (rows - 1)), &u, &v,
      &depth);
  u = u + (real)0.5f * (upright_bins - 1);
  v = v + (real)0.5f * (upright_rows - 1);
  const lanes_int inside = depth > 0 && within(u, upright_bins) && within(v, upright_rows);
  u = inside ? u : 1.0f;
  v = inside ? v : 1.0f;
  lanes_int c = floor_int(u) - 1, r = floor_int(v) - 1;
#if SPLINE
  const int taps = upright_rows < 4 ? upright_rows : 4;
  c = c < upright_bins - 4 ? c : upright_bins - 4;
  r = r < upright_rows - taps ? r : upright_rows - taps;
  c = c > 0 ? c : 0;
  r = r > 0 ? r : 0;
#else
  const int taps = 4;
#endif
  int at[LANES] __attribute__((aligned(sizeof(int) * LANES)));
  KEEP_INTS(at, r * upright_bins + c);
  __global const real *seen = upright + (long)view * upright_rows * upright_bins;
  const lanes x = u - TO_FLOAT(c), y = v - TO_FLOAT(r);
  lanes sum = 0;
  for (int n = 0; n < taps; n++) {
    const lane_quad q = quads_at(seen + (long)n * upright_bins, at);
    const lanes row = BY_COLUMN(0) * q.s0 + BY_COLUMN(1) * q.s1 + BY_COLUMN(2) * q.s2 +
        BY_COLUMN(3) * q.s3;
    sum = sum + BY_ROW(n) * row;
  }
  sum = inside ? sum : 0;
  __global real *out = data + ((long)views[first + view] * rows + i) * bins + k0;
  real last[LANES] __attribute__((aligned(sizeof(lanes))));
  *(lanes *)last = sum;
  for (int n = 0; n < LANES && k0 + n < bins; n++) out[n] = last[n];
}
