/* One step of Adam (Kingma and Ba, 2015) on an array of parameters.
 *
 *     m = beta1 m + (1 - beta1) g,      v = beta2 v + (1 - beta2) g^2,
 *     x -= rate m c1 / (sqrt(v c2) + epsilon),      c = 1 / (1 - beta^step).
 *
 * Parameters repeat with a period (the coefficients of one splat's colour, say), and each place of
 * the period has its own share of the rate: `shares` holds two periods and LANES more, so that a run
 * of LANES parameters reads its shares from wherever it begins.
 *
 * Index space: (runs of RUN parameters). */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

static lanes moved(lanes m, lanes v, lanes rate, float c1, float c2, float epsilon) {
  return rate * (m * c1) / (sqrt(v * c2) + epsilon);
}

KERNEL void adam(
    __global float *restrict x, __global float *restrict m, __global float *restrict v,
    __global const float *restrict g, __global const float *restrict shares,
    int period, float rate, float beta1, float beta2, float c1, float c2, float epsilon, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  int place = (int)(begin % (ulong)period);
  ulong i = begin;
  for (; i + LANES <= end; i += LANES) {
    const lanes gi = LOAD(g + i);
    const lanes mi = beta1 * LOAD(m + i) + (1 - beta1) * gi;
    const lanes vi = beta2 * LOAD(v + i) + (1 - beta2) * gi * gi;
    STORE(m + i, mi);
    STORE(v + i, vi);
    STORE(x + i, LOAD(x + i) - moved(mi, vi, rate * LOAD(shares + place), c1, c2, epsilon));
    place += LANES;
    while (place >= period) place -= period;
  }
  for (; i < end; i++) {
    m[i] = beta1 * m[i] + (1 - beta1) * g[i];
    v[i] = beta2 * v[i] + (1 - beta2) * g[i] * g[i];
    x[i] -= rate * shares[place] * (m[i] * c1) / (sqrt(v[i] * c2) + epsilon);
    if (++place == period) place = 0;
  }
}
