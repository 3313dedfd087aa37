/* How rough every detector column is along the views.
 *
 *     rough[c] = mean over v of |x[c][v] - mean of x[c][v - 5 .. v + 4]|
 *
 * with the first and the last view repeated beyond the ends. A bin that answers to no view is much
 * smoother than its neighbours, one that fluctuates much rougher.
 *
 * Index space: columns. At least SPAN views.
 *
 * Buffers: values[columns, views], rough[columns]. */

#include "include/portable.h"
#include "include/transpose.h"

#define SPAN 10
#define BEFORE (SPAN / 2)

static float clamped_at(__global const float *x, int v, int views) {
  return x[v < 0 ? 0 : v < views ? v : views - 1];
}

static float departure(__global const float *x, int v, int views) {
  float sum = 0;
  for (int k = -BEFORE; k < SPAN - BEFORE; k++) sum += clamped_at(x, v + k, views);
  const float away = x[v] - sum * (1.0f / SPAN);
  return away < 0 ? -away : away;
}

KERNEL void column_roughness(
    __global const float *restrict values, __global float *restrict rough, int columns, int views)
{
  const int c = (int)get_global_id(0);
  if (c >= columns) return;
  __global const float *x = values + (long)c * views;
  float ends = 0;
  lanes sums = 0;
  int v = 0;
  for (; v < BEFORE; v++) ends += departure(x, v, views);
  for (; v + SPAN - BEFORE + LANES - 1 <= views; v += LANES) {
    lanes sum = 0;
    UNROLL for (int k = -BEFORE; k < SPAN - BEFORE; k++) sum += LOAD(x + v + k);
    sums += absolute(LOAD(x + v) - sum * (1.0f / SPAN));
  }
  for (; v < views; v++) ends += departure(x, v, views);
  rough[c] = (SUM_OF_LANES(sums) + ends) / views;
}
