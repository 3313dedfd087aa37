/* Replace pixels that stand out of their neighbourhood by its median.
 *
 * With d = x - median (and, if DARK, also with d = median - x) a pixel is replaced where
 *
 *     d > least[row]   and   d > 2 limit sqrt(max(median, floor[row])) + limit^2
 *
 * with the pixel's own limit[row][bin], and, if ALONE, where no pixel near it in the view before
 * and the one behind is half as far from the median: what several views see belongs to the object.
 * Near are a row on either side, and BINS_BESIDE bins, by as many as the object may move between
 * views. `levels` holds least and floor of each row.
 *
 * Index space: (runs of RUN bins, rows, views).
 *
 * Buffers: x, medians, out[views, rows, bins], limits[rows, bins], levels[rows, 2]. */

#include "include/portable.h"
#include "include/tomo/neighbours.h"

#pragma OPENCL FP_CONTRACT OFF

#ifndef DARK
#define DARK 0
#endif
#ifndef ALONE
#define ALONE 1
#endif
#ifndef BINS_BESIDE
#define BINS_BESIDE 1
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

/* The farthest that a pixel of the views beside `view` lies above (sign 1) or below (-1) a level. */
static float farthest_beside(
    __global const float *x, float level, float sign, int view, int row, int bin,
    int views, int rows, int bins)
{
  float most = -INFINITY;
  for (int v = view - 1; v <= view + 1; v += 2) {
    if (v < 0 || v >= views) continue;
    for (int r = row - 1; r <= row + 1; r++)
      for (int b = bin - BINS_BESIDE; b <= bin + BINS_BESIDE; b++) {
        const long at = ((long)v * rows + within(r, rows)) * bins + within(b, bins);
        const float away = sign * (x[at] - level);
        most = away > most ? away : most;
      }
  }
  return most;
}

KERNEL void zinger_replace(
    __global const float *restrict x, __global const float *restrict medians,
    __global const float *restrict limits, __global const float *restrict levels,
    __global float *restrict out, int views, int rows, int bins)
{
  const int row = (int)get_global_id(1), view = (int)get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < bins ? begin + RUN : bins;
  const long at = ((long)view * rows + row) * bins;
  const float least = levels[2 * row], floor = levels[2 * row + 1];
  for (int bin = begin; bin < end; bin++) {
    const float value = x[at + bin], median = medians[at + bin], limit = limits[row * bins + bin];
    const float above = value - median, d = DARK && above < 0 ? -above : above;
    const float level = median > floor ? median : floor;
    const float over = d - limit * limit;
    bool out_of_line = d > least && over > 0 && over * over > 4 * limit * limit * level;
    if (ALONE && out_of_line) {
      const float sign = above < 0 ? -1.0f : 1.0f;
      out_of_line = d > 2 * farthest_beside(x, median, sign, view, row, bin, views, rows, bins);
    }
    out[at + bin] = out_of_line ? median : value;
  }
}
