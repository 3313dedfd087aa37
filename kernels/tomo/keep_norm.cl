/* Give an array the norm that another one had: x *= sqrt(wanted / found), from sums of squares.
 *
 * The sums stay on the device, so that nobody waits for them. An array of zeros stays one.
 * Index space: (runs of RUN samples).
 *
 * Buffers: x[size], wanted, found[1]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void keep_norm(
    __global float *x, __global const float *wanted, __global const float *found, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  const float factor = found[0] > 0 ? sqrt(wanted[0] / found[0]) : 1;
  for (ulong i = begin; i < end; i++) x[i] *= factor;
}
