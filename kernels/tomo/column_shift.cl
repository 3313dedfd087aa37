/* Subtract a number from every detector column.
 *
 *     x[c][v] -= shift[c]
 *
 * Index space: (runs of RUN views, bins, rows): a grid's further axes end at 65,535 on some GPUs.
 *
 * Buffers: x[along2, bins, views], shift[along2, bins]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void column_shift(__global float *x, __global const float *restrict shift, int bins, int views)
{
  const int begin = (int)get_global_id(0) * RUN;
  const int end = begin + RUN < views ? begin + RUN : views;
  const long column = get_global_id(2) * (long)bins + get_global_id(1);
  const long at = column * views;
  const float by = shift[column];
  for (int v = begin; v < end; v++) x[at + v] -= by;
}
