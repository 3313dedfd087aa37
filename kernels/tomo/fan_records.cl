/* A fan's views to what fan_backproject reads of a ray in one piece:
 *
 *     record[view][ray] = (start, q, step, value)
 *
 * of strips, whose rays are the edges before bin `ray`: value is the bin's, times its factor, step
 * what it is less than that of the bin before; of hats, whose rays are those of bins: value, and
 * for step the bin's width in lines. Rays beyond the last bin have the value 0.
 *
 * `first` is the first view of this run. Index space: (runs of RUN rays, views of the run).
 *
 * Buffers: records[along1, stride, 4], sinogram[along1, bins], starts, slopes, widths,
 * factors[first + along1, stride], numbers[first + along1, VIEW_NUMBERS], views[first + along1]. */

#include "include/portable.h"
#include "include/tomo/fan_footprint.h"

#if DOUBLE
typedef double4 ray_record;
#else
typedef float4 ray_record;
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 64 : 1)
#endif

static real value_of(
    __global const real *row, __global const real *factors, int r, int bins, int mirrored)
{
  return r < 0 || r >= bins ? 0 : row[mirrored ? bins - 1 - r : r] * factors[r];
}

KERNEL void fan_records(
    __global real *restrict records, __global const real *restrict sinogram,
    __global const real *restrict starts, __global const real *restrict slopes,
    __global const real *restrict widths, __global const real *restrict factors,
    __global const real *restrict numbers, __global const int *restrict views, int bins, int stride,
    int first)
{
  const int number = first + (int)get_global_id(1);
  const int mirrored = (int)numbers[(long)number * VIEW_NUMBERS + MIRRORED];
  const int r0 = (int)get_global_id(0) * RUN, r1 = r0 + RUN < stride ? r0 + RUN : stride;
  const long at = (long)number * stride;
  __global const real *row = sinogram + (long)views[number] * bins;
  __global ray_record *out =
      (__global ray_record *)records + (long)(number - first) * stride;
  for (int r = r0; r < r1; r++) {
    const real value = value_of(row, factors + at, r, bins, mirrored);
#if FOOTPRINT == 0
    const real step = value_of(row, factors + at, r - 1, bins, mirrored) - value;
#else
    const real step = widths[at + r];
#endif
    out[r] = (ray_record)(starts[at + r], slopes[at + r], step, value);
  }
}
