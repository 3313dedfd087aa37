/* Rows of a detector become the columns of a Fourier transform, two bins to a complex sample.
 *
 * A transform of 2 length real numbers is made of one of length complex ones: sample n has bin 2n
 * as its real part and bin 2n + 1 as its imaginary one (rows_weigh.cl takes the two apart). Behind
 * the last bin there are zeros. `planes` holds the real parts, (length, columns), then the
 * imaginary ones.
 *
 * Index space: (runs of RUN bins, blocks of LANES rows), each block transposed in registers. Rows
 * begin at `first`; what stands past the last repeats it and is never read. */

#include "include/portable.h"
#include "include/transpose.h"

#ifndef RUN
#define RUN (LANES == 8 ? 1024 : 1)
#endif

KERNEL void rows_pack(
    __global const real *restrict rows, __global real *restrict planes,
    int first, int count, int bins, int length, int columns)
{
  const int begin = (int)get_global_id(0) * RUN, c = (int)get_global_id(1) * LANES;
  const int end = begin + RUN < 2 * length ? begin + RUN : 2 * length;
  const long plane = (long)length * columns;
  __global const real *row[LANES];
  UNROLL for (int k = 0; k < LANES; k++)
    row[k] = rows + (long)(first + (c + k < count ? c + k : count - 1)) * bins;
  for (int b = begin; b < end; b += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      block[k] = 0;
      if (b + LANES <= bins) block[k] = LOAD(row[k] + b);
      else for (int n = 0; b + n < bins; n++) ((real *)&block[k])[n] = row[k][b + n];
    }
    TRANSPOSE(block)
    UNROLL for (int k = 0; k < LANES; k++)
      if (b + k < end) STORE(planes + ((b + k) & 1) * plane + (long)((b + k) >> 1) * columns + c, block[k]);
  }
}
