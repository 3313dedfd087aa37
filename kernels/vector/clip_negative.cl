/* y = max(y, 0), sample by sample: the nearest image without negative values.
 *
 * NaN stays NaN, so that it shows. Index space: (runs of RUN samples).
 *
 * Buffers: y[size]. */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void clip_negative(__global real *y, ulong size)
{
  const ulong begin = (ulong)get_global_id(0) * RUN;
  const ulong end = begin + RUN < size ? begin + RUN : size;
  for (ulong i = begin; i < end; i++) y[i] = y[i] < 0 ? 0 : y[i];
}
