/* y = min(max(y, low), high), sample by sample: the nearest image between two others.
 *
 * NaN stays NaN, so that it shows. Index space: (runs of RUN samples).
 *
 * Buffers: low, high, y[size]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void clip_between(
    __global const real *low, __global const real *high, __global real *y, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  for (ulong i = begin; i < end; i++)
    y[i] = y[i] < low[i] ? low[i] : y[i] > high[i] ? high[i] : y[i];
}
