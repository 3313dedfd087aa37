/* Views of tilted detectors to upright ones: the transpose of upright_read, by gathering.
 *
 *     upright[view][r][c] = sum over i, k of cubic(v - r) cubic(u - c) data[view][i][k]
 *
 * over the pixels that see a place within two rows and columns of (r, c). They lie within the
 * rectangle about the four corners of that square, taken the way back; where the way back has no
 * end, all pixels are tried. Index space: (runs of LANES columns, rows of the upright detector, views of
 * the run).
 *
 * Buffers: data[along2, rows, bins], upright[along2, upright_rows, upright_bins],
 * forms[first + along2, VIEW_FORMS], views[first + along2]. */

#include "include/portable.h"
#include "include/lane_quads.h"
#include "include/cone/upright.h"

static lanes smaller(lanes a, lanes b) { return a < b ? a : b; }
static lanes greater(lanes a, lanes b) { return a > b ? a : b; }

KERNEL void upright_spread(
    __global const real *restrict data, __global real *restrict upright,
    __global const real *restrict forms, __global const int *restrict views, int first, int rows,
    int bins, int upright_rows, int upright_bins)
{
  const int c0 = (int)get_global_id(0) * LANES, r = (int)get_global_id(1);
  const int view = (int)get_global_id(2);
  if (c0 >= upright_bins) return;
  __global const real *h = forms + (long)(first + view) * VIEW_FORMS;
  __global const real *pixels = data + (long)views[first + view] * rows * bins;
  const real middle_u = (real)0.5f * (upright_bins - 1), middle_v = (real)0.5f * (upright_rows - 1);
  const real middle_k = (real)0.5f * (bins - 1), middle_i = (real)0.5f * (rows - 1);
  const lanes column = (real)c0 + LANE_NUMBERS;
  lanes low_k = (real)bins, high_k = -1.0f, low_i = (real)rows, high_i = -1.0f, ends = 1.0f;
  for (int corner = 0; corner < 4; corner++) {
    lanes k, i, depth;
    const lanes u = column - middle_u + (corner & 1 ? 2.0f : -2.0f);
    const real v = r - middle_v + (corner & 2 ? 2.0f : -2.0f);
    seen_at(h + WAY_BACK, u, (lanes)v, &k, &i, &depth);
    ends = depth > 0 ? ends : 0;
    low_k = smaller(low_k, k + middle_k);
    high_k = greater(high_k, k + middle_k);
    low_i = smaller(low_i, i + middle_i);
    high_i = greater(high_i, i + middle_i);
  }
  /* Weights end at these edges: pixels strictly between them count, and those that round to them. */
  low_k = greater(ends > 0 ? low_k - 0.01f : -1.0f, -1.0f);
  low_i = greater(ends > 0 ? low_i - 0.01f : -1.0f, -1.0f);
  high_k = smaller(ends > 0 ? high_k + 0.01f : (real)bins, (real)(bins - 1));
  high_i = smaller(ends > 0 ? high_i + 0.01f : (real)rows, (real)(rows - 1));
  low_k = smaller(low_k, (real)(bins - 1));
  const real from = -largest_lane(-low_i), to = largest_lane(high_i);
  const int i0 = from < 0 ? 0 : (int)(from < rows ? from : rows) + 1, i1 = to < 0 ? -1 : (int)to;
  const lanes_int k0 = floor_int(low_k) + 1;
  const int count = (int)largest_lane(high_k - TO_FLOAT(k0)) + 1;
  lanes sum = 0;
  for (int i = i0; i <= i1; i++)
    for (int n = 0; n < count; n++) {
      lanes u, v, depth;
      const lanes_int k = k0 + n;
      seen_at(
          h, TO_FLOAT(k) - middle_k, (lanes)(i - middle_i), &u, &v, &depth);
      u = u + middle_u;
      v = v + middle_v;
      const lanes_int inside =
          k < bins && depth > 0 && within(u, upright_bins) && within(v, upright_rows);
      const lanes_int there = k < bins ? k : bins - 1;
      const lanes weight =
          share(u, column, upright_bins) * share(v, (lanes)(real)r, upright_rows);
      sum = sum + (inside ? weight : 0) * GATHER(pixels + (long)i * bins, there);
    }
  __global real *out = upright + ((long)view * upright_rows + r) * upright_bins + c0;
  real last[LANES] __attribute__((aligned(sizeof(lanes))));
  *(lanes *)last = sum;
  for (int n = 0; n < LANES && c0 + n < upright_bins; n++) out[n] = last[n];
}
