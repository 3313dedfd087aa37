/* y += strength (middle - x), where middle is that of the two levels between which x lies.
 *
 * The gradient of strength/2 (x - low)(high - x), which is zero at each level and bulges up between
 * them. Beyond the first and the last level the outermost two count. Index space: (runs of RUN
 * samples).
 *
 * Buffers: levels[count], x, y[size]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void level_pull(
    __global const real *levels, int count, real strength,
    __global const real *x, __global real *y, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  for (ulong i = begin; i < end; i++) {
    int above = 1;
    while (above < count - 1 && x[i] > levels[above]) above++;
    y[i] += strength * ((real)0.5 * (levels[above - 1] + levels[above]) - x[i]);
  }
}
