/* One step of Adam (Kingma and Ba, 2015) on an array of parameters.
 *
 *     m = beta1 m + (1 - beta1) g,      v = beta2 v + (1 - beta2) g^2,
 *     x -= rate m c1 / (sqrt(v c2) + epsilon),      c = 1 / (1 - beta^step).
 *
 * Parameters repeat with a period (the coefficients of one splat's colour, say), and each place of
 * the period has its own share of the rate: `shares` holds two periods and LANES more, so that a run
 * of LANES parameters reads its shares from wherever it begins.
 *
 * Index space: (runs of RUN parameters).
 *
 * Buffers: x, g, m, v[size], shares[period + LANES - 1]. */

#include "include/portable.h"
#include "include/train/adam_step.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void adam(
    __global float *restrict x, __global const float *restrict g, ADAM_PARAMETERS, ulong size)
{
  const Adam a = ADAM_GIVEN;
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  adam_between(x, a, begin, end, g);
}
