/* Weights of rays that are products of two factors, one for each (row, bin) of the detector and one
 * for each (view, bin), while views are laid onto a wider or a narrower detector:
 *
 *     out[view][row][k] = pixels[row][j] * views[view][j] * x[view][row][k + shift],
 *     j = k + weight_shift;                 0 where k + shift is no bin of `x`.
 *
 * With `weight_shift` 0 and `shift` -n a detector is widened by n bins before its first one; its
 * transpose has n for both. A stride of 0 means that all rows, or all views, have the same factors.
 * `x` may be `out` where the detector stays as it is.
 *
 * Index space: (blocks of BINS bins, runs of RUN rows of all views).
 *
 * Buffers: x[lines, x_bins], out[lines, bins],
 * pixels[(min(lines, rows) - 1) * pixel_stride + weight_shift + min(bins, x_bins - shift)],
 * views[(lines - 1) / rows * view_stride + weight_shift + min(bins, x_bins - shift)]. */

#include "include/portable.h"

#ifndef BINS
#define BINS (LANES == 8 ? 1024 : 1)
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 16 : 1)
#endif

KERNEL void rays_weigh(
    __global const real *x, __global real *out, __global const real *pixels,
    __global const real *views, ulong lines, int rows, int x_bins, int bins, int pixel_stride,
    int view_stride, int shift, int weight_shift)
{
  const int left = (int)get_global_id(0) * BINS;
  const int right = left + BINS < bins ? left + BINS : bins;
  const ulong begin = (ulong)get_global_id(1) * RUN;
  const ulong end = begin + RUN < lines ? begin + RUN : lines;
  for (ulong line = begin; line < end; line++) {
    __global const real *ray = x + line * x_bins;
    __global const real *p = pixels + (line % rows) * pixel_stride + weight_shift;
    __global const real *v = views + (line / rows) * view_stride + weight_shift;
    __global real *y = out + line * bins;
    for (int k = left; k < right; k++)
      y[k] = k + shift >= 0 && k + shift < x_bins ? p[k] * v[k] * ray[k + shift] : 0;
  }
}
