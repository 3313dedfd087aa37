/* Views become the complex columns of a Fourier transform, two views to a column.
 *
 *     fields[part][r][c] = view of ray (part * columns + c) at bin (start + r),
 *
 * part 0 real, part 1 imaginary. Each view begins at its own bin, so that the image's shadow always
 * falls on rows 0 .. window - 1; behind them, off the detector and behind the last ray there are
 * zeros. Index space: (blocks of LANES columns, runs of RUN rows, parts). Length and columns are
 * multiples of LANES. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier_rays.h"

#ifndef RUN
#define RUN (LANES == 8 ? 256 : 1)
#endif

KERNEL void rays_pack(
    __global const float *restrict views, __global float *restrict fields,
    __global const int *restrict order, __global const int *restrict starts,
    int rays, int slice, int slices, int bins, int window, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, part = (int)get_global_id(2);
  if (c >= columns) return;
  const int begin = (int)get_global_id(1) * RUN;
  const int end = begin + RUN < length ? begin + RUN : length;
  __global float *out = fields + (long)part * length * columns + c;
  for (int r = begin; r < end; r += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      const int ray = part * columns + c + k;
      block[k] = 0;
      if (ray < rays) {
        const int last = starts[ray] + window < bins ? starts[ray] + window : bins;
        block[k] = load_between(views + ((long)order[ray] * slices + slice) * bins, starts[ray] + r, last);
      }
    }
    TRANSPOSE(block)
    UNROLL for (int k = 0; k < LANES; k++) STORE(out + (long)(r + k) * columns, block[k]);
  }
}
