/* The mean of every ranked detector column without its lowest and highest values.
 *
 *     level[c] = mean of ranked[c][dropped .. views - dropped - 1]
 *
 * Index space: columns.
 *
 * Buffers: ranked[columns, views], level[columns]. */

#include "include/portable.h"
#include "include/transpose.h"

KERNEL void column_level(
    __global const float *restrict ranked, __global float *restrict level,
    int columns, int views, int dropped)
{
  const int c = (int)get_global_id(0);
  if (c >= columns) return;
  __global const float *x = ranked + (long)c * views;
  const int end = views - dropped;
  lanes sums = 0;
  float rest = 0;
  int k = dropped;
  for (; k + LANES <= end; k += LANES) sums += LOAD(x + k);
  for (; k < end; k++) rest += x[k];
  level[c] = (SUM_OF_LANES(sums) + rest) / (end - dropped);
}
