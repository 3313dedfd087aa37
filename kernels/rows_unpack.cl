/* The columns of a Fourier transform become rows of a detector again: rows_pack.cl backwards.
 *
 * Each row is multiplied by its view's gain. Index space: (runs of RUN bins, blocks of LANES
 * rows), each block transposed in registers. */

#include "include/portable.h"
#include "include/transpose.h"

#ifndef RUN
#define RUN (LANES == 8 ? 1024 : 1)
#endif

KERNEL void rows_unpack(
    __global const real *restrict planes, __global real *restrict rows, __global const real *restrict gains,
    int first, int count, int rows_per_view, int bins, int length, int columns)
{
  const int begin = (int)get_global_id(0) * RUN, c = (int)get_global_id(1) * LANES;
  const int end = begin + RUN < bins ? begin + RUN : bins;
  const long plane = (long)length * columns;
  for (int b = begin; b < end; b += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      const int from = b + k < end ? b + k : end - 1;
      block[k] = LOAD(planes + (from & 1) * plane + (long)(from >> 1) * columns + c);
    }
    TRANSPOSE(block)
    for (int k = 0; k < LANES && c + k < count; k++) {
      const int row = first + c + k;
      __global real *out = rows + (long)row * bins + b;
      const lanes values = gains[row / rows_per_view] * block[k];
      if (b + LANES <= end) STORE(out, values);
      else for (int n = 0; b + n < end; n++) out[n] = ((const real *)&values)[n];
    }
  }
}
