/* An image to the bins of a fan: the transpose of fan_backproject, by gathering.
 *
 *     out[view][bin] = factor[bin] * sum over slabs b of weight(b) *
 *                      sum over pixels i of share(ray, b, i) * plane[b][i]
 *
 * with the weights and shares of include/tomo/fan_footprint.h.
 *
 * Index space: (runs of LANES bins, views). Each item owns its bins. The plane has `margin` zeros
 * before and after every slab, more than a bin reaches in lines, so that no pixel needs a bounds
 * test; pixels before the first of these are left out. */

#include "include/portable.h"
#include "include/tomo/fan_footprint.h"
#include "include/lane_quads.h"

/* Slabs whose first pixels are found together. */
#ifndef ROWS
#define ROWS (LANES == 8 ? 16 : 1)
#endif

/* Slabs that are summed before they are added to the others. Sums of sums round less. */
#define TOGETHER 16

KERNEL void fan_project(
    __global real *restrict sinogram, __global const real *restrict plane,
    __global const real *restrict starts, __global const real *restrict slopes,
    __global const real *restrict widths, __global const real *restrict factors,
    __global const real *restrict numbers, __global const int *restrict views, int bins, int stride,
    int slabs, int lines, int margin)
{
  const int r = (int)get_global_id(0) * LANES, number = (int)get_global_id(1);
  if (r >= bins) return;
  const long at = (long)number * stride + r;
  __global const real *view = numbers + (long)number * VIEW_NUMBERS;
  const lanes low = LOAD(starts + at), low_q = LOAD(slopes + at);
#if FOOTPRINT == 0
  const lanes high = LOAD(starts + at + 1), high_q = LOAD(slopes + at + 1);
  const lanes low_c = slant_of(low_q), high_c = slant_of(high_q);
  const lanes low_half = 0.5f / low_c, high_half = 0.5f / high_c;
#else
  const lanes width = LOAD(widths + at);
#endif
  const real middle = (real)0.5f * (slabs - 1), inverse_depth = view[INVERSE_DEPTH];
  int first[ROWS * LANES] __attribute__((aligned(sizeof(int) * LANES)));
  lanes total = 0;
  lanes sum = 0;
  for (int b0 = 0; b0 < slabs; b0 += ROWS) {
    const int rows = b0 + ROWS < slabs ? ROWS : slabs - b0;
    for (int n = 0; n < rows; n++) {
      const real s = b0 + n - middle;
      const lanes place = low + s * low_q;
#if FOOTPRINT == 0
      lanes_int i = floor_int(place - low_c);
#else
      const real rho = 1.0f / (1.0f + s * inverse_depth);
      lanes_int i = floor_int(place - (width > rho ? width / rho : 1.0f)) + 1;
#endif
      i = i < -1 ? -1 : i;
      i = i > lines ? lines : i;
      KEEP_INTS(first + n * LANES, i);
    }
    for (int n = 0; n < rows; n++) {
      const real s = b0 + n - middle;
      const real rho = 1.0f / (1.0f + s * inverse_depth);
      __global const real *slab = plane + (long)(b0 + n) * (lines + 2 * margin) + margin;
      const lanes i = TO_FLOAT(KEPT_INTS(first + n * LANES));
      lanes part = 0, z = (low + s * low_q) - i;
#if FOOTPRINT == 0
      lanes x = (high + s * high_q) - i;
      const lanes end = x;
      lanes upper_z = clamped(z, low_c), upper_x = clamped(x, high_c);
#define TAKE(pixel) { \
        const lanes beyond_z = z - low_c, beyond_x = x - high_c; \
        z = z - 1.0f; \
        x = x - 1.0f; \
        const lanes lower_z = clamped(z, low_c), lower_x = clamped(x, high_c); \
        part = part + (part_before(beyond_x, upper_x, lower_x, high_half) - \
                       part_before(beyond_z, upper_z, lower_z, low_half)) * (pixel); \
        upper_z = lower_z; \
        upper_x = lower_x; }
#else
      const lanes reach = width > rho ? width / rho : 1.0f, inverse = 1.0f / reach;
      const lanes end = z + reach;
#define TAKE(pixel) { \
        part = part + hat(z, inverse) * (pixel); \
        z = z - 1.0f; }
#endif
      /* Pixels from `end` on have no share, and those behind the last line are zeros. */
      const lanes rest = (real)lines - i;
      const int most = (int)largest_lane(end < rest ? end : rest) + 1;
      for (int m = 0; m < most; m += 4) {
        const lane_quad pixels = quads_at(slab + m, first + n * LANES);
        TAKE(pixels.s0)
        if (m + 1 < most) TAKE(pixels.s1)
        if (m + 2 < most) TAKE(pixels.s2)
        if (m + 3 < most) TAKE(pixels.s3)
      }
      sum = sum + SLAB_WEIGHT(rho) * part;
    }
    if ((b0 + ROWS) % TOGETHER == 0) {
      total = total + sum;
      sum = 0;
    }
  }
  total = (total + sum) * LOAD(factors + at);
  __global real *out = sinogram + (long)views[number] * bins;
  const int mirrored = (int)view[MIRRORED];
  real last[LANES] __attribute__((aligned(sizeof(lanes))));
  *(lanes *)last = total;
  for (int n = 0; n < LANES && r + n < bins; n++)
    out[mirrored ? bins - 1 - r - n : r + n] = last[n];
}
