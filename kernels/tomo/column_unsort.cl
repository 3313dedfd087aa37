/* Put ranked values back to the views that they came from: the inverse of column_sort.
 *
 *     values[c][order[c][k]] = ranked[c][k]
 *
 * Index space: (runs of RUN ranks, bins, rows): a grid's further axes end at 65,535 on some GPUs.
 *
 * Buffers: ranked, order, values[along2, bins, views]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void column_unsort(
    __global const float *restrict ranked, __global const int *restrict order,
    __global float *restrict values, int bins, int views)
{
  const int begin = (int)get_global_id(0) * RUN;
  const int end = begin + RUN < views ? begin + RUN : views;
  const long column = get_global_id(2) * (long)bins + get_global_id(1);
  const long at = column * views;
  for (int k = begin; k < end; k++) values[at + order[at + k]] = ranked[at + k];
}
