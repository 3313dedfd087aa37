/* y = w y, sample by sample: the weights of rays and pixels.
 *
 * Index space: (runs of RUN samples).
 *
 * Buffers: w, y[size]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void multiply(__global const real *w, __global real *y, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  for (ulong i = begin; i < end; i++) y[i] = w[i] * y[i];
}
