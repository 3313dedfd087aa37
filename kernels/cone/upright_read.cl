/* Upright views to those of tilted detectors (include/cone/upright.h):
 *
 *     data[view][i][k] = sum over r, c of cubic(v - r) cubic(u - c) upright[view][r][c].
 *
 * With SLOPE 1 it is the derivative by u, with SLOPE 2 that by v. Pixels whose four rows and columns
 * are not all there are zero. `first` is the first view of the
 * run, `views` tells which view of the data each is. Index space: (runs of LANES columns, rows of
 * the tilted detector, views of the run). */

#include "include/portable.h"
#include "include/lane_quads.h"
#include "include/cone/upright.h"

#ifndef SLOPE
#define SLOPE 0
#endif
#define BY_COLUMN(d) (SLOPE == 1 ? keys_slope(d) : cubic(d))
#define BY_ROW(d) (SLOPE == 2 ? keys_slope(d) : cubic(d))

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
  const lanes_int inside =
      depth > 0 && u >= 1.0f && u < (real)(upright_bins - 2) && v >= 1.0f && v < (real)(upright_rows - 2);
  u = inside ? u : 1.0f;
  v = inside ? v : 1.0f;
  const lanes_int c = floor_int(u) - 1, r = floor_int(v) - 1;
  int at[LANES] __attribute__((aligned(sizeof(int) * LANES)));
  KEEP_INTS(at, r * upright_bins + c);
  __global const real *seen = upright + (long)view * upright_rows * upright_bins;
  const lanes x = u - TO_FLOAT(c), y = v - TO_FLOAT(r);
  lanes sum = 0;
  for (int n = 0; n < 4; n++) {
    const lane_quad q = quads_at(seen + (long)n * upright_bins, at);
    const lanes row = BY_COLUMN(x) * q.s0 + BY_COLUMN(x - 1.0f) * q.s1 +
        BY_COLUMN(x - 2.0f) * q.s2 + BY_COLUMN(x - 3.0f) * q.s3;
    sum = sum + BY_ROW(y - (real)n) * row;
  }
  sum = inside ? sum : 0;
  __global real *out = data + ((long)views[first + view] * rows + i) * bins + k0;
  real last[LANES] __attribute__((aligned(sizeof(lanes))));
  *(lanes *)last = sum;
  for (int n = 0; n < LANES && k0 + n < bins; n++) out[n] = last[n];
}
