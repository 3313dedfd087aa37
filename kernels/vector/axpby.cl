/* y = a x + b y, sample by sample: what sums and multiples of operators are made of.
 *
 * Index space: (runs of RUN samples).
 *
 * Buffers: x, y[size]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void axpby(__global const real *x, __global real *y, real a, real b, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  for (ulong i = begin; i < end; i++) y[i] = a * x[i] + b * y[i];
}
