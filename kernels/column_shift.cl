/* Subtract a number from every detector column.
 *
 *     x[c][v] -= shift[c]
 *
 * Index space: (runs of RUN views, columns). */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void column_shift(__global float *x, __global const float *restrict shift, int views)
{
  const int begin = (int)get_global_id(0) * RUN;
  const int end = begin + RUN < views ? begin + RUN : views;
  const long at = get_global_id(1) * (long)views;
  const float by = shift[get_global_id(1)];
  for (int v = begin; v < end; v++) x[at + v] -= by;
}
