/* The median of every pixel's neighbourhood in a stack of projections.
 *
 *     out[view][row][bin] = median of x[view +- VIEWS_AWAY][row +- ROWS_AWAY][bin +- BINS_AWAY]
 *
 * Beyond the stack's ends pixels are mirrored. Values are sorted as they come, in registers.
 *
 * Index space: (runs of RUN bins, rows, views).
 *
 * Buffers: x, out[views, rows, bins]. */

#include "include/portable.h"
#include "include/tomo/neighbours.h"

#ifndef VIEWS_AWAY
#define VIEWS_AWAY 0
#endif
#ifndef ROWS_AWAY
#define ROWS_AWAY 1
#endif
#ifndef BINS_AWAY
#define BINS_AWAY 1
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif
#define COUNT ((2 * VIEWS_AWAY + 1) * (2 * ROWS_AWAY + 1) * (2 * BINS_AWAY + 1))

KERNEL void local_median(
    __global const float *restrict x, __global float *restrict out, int views, int rows, int bins)
{
  const int row = (int)get_global_id(1), view = (int)get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < bins ? begin + RUN : bins;
  const long at = ((long)view * rows + row) * bins;
  for (int bin = begin; bin < end; bin += LANES) {
    lanes sorted[COUNT];
    UNROLL for (int i = 0; i < COUNT; i++) sorted[i] = INFINITY;
    for (int v = view - VIEWS_AWAY; v <= view + VIEWS_AWAY; v++)
      for (int r = row - ROWS_AWAY; r <= row + ROWS_AWAY; r++) {
        const long line = ((long)within(v, views) * rows + within(r, rows)) * bins;
        for (int b = bin - BINS_AWAY; b <= bin + BINS_AWAY; b++) {
          const lanes value = bins_from(x + line, b, bins);
          UNROLL for (int i = COUNT - 1; i > 0; i--) {
            const lanes lower = sorted[i] < value ? sorted[i] : value;
            sorted[i] = lower < sorted[i - 1] ? sorted[i - 1] : lower;
          }
          sorted[0] = value < sorted[0] ? value : sorted[0];
        }
      }
#if LANES == 8
    if (bin + LANES > bins) {
      const float last[8] = {sorted[COUNT / 2].s0, sorted[COUNT / 2].s1, sorted[COUNT / 2].s2,
                             sorted[COUNT / 2].s3, sorted[COUNT / 2].s4, sorted[COUNT / 2].s5,
                             sorted[COUNT / 2].s6, sorted[COUNT / 2].s7};
      for (int b = bin; b < bins; b++) out[at + b] = last[b - bin];
      continue;
    }
#endif
    STORE(out + at + bin, sorted[COUNT / 2]);
  }
}
