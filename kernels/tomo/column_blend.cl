/* Fill detector columns from two others along straight lines.
 *
 *     x[hole[i]][v] = (1 - share[i]) x[left[i]][v] + share[i] x[right[i]][v]
 *
 * No hole is another's neighbour. The products are rounded before they are added, on every device,
 * so that columns that are sorted stay sorted.
 *
 * Index space: (runs of RUN views, holes). `table` holds hole, left and right of each.
 *
 * Buffers: x[*], table[along1, 3], shares[along1]. */

#include "include/portable.h"

#pragma OPENCL FP_CONTRACT OFF

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void column_blend(
    __global float *x, __global const int *restrict table, __global const float *restrict shares,
    int views)
{
  const int i = (int)get_global_id(1), begin = (int)get_global_id(0) * RUN;
  const int end = begin + RUN < views ? begin + RUN : views;
  __global float *hole = x + (long)table[3 * i] * views;
  __global const float *left = x + (long)table[3 * i + 1] * views;
  __global const float *right = x + (long)table[3 * i + 2] * views;
  const float share = shares[i], rest = 1.0f - share;
  for (int v = begin; v < end; v++) {
    const float a = rest * left[v], b = share * right[v];
    hole[v] = a + b;
  }
}
