/* Between the two halves of the inverse transform, for GPUs (see include/fourier/row_pairs.h).
 *
 * Index space: (blocks of LANES pairs, blocks of LANES frequencies 0 .. edge / 2).
 *
 * Buffers: grid[2, rows, columns], fields[2, edge, pairs]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/row_pairs.h"

KERNEL void spectrum_fold_gpu(
    __global const float *restrict grid, __global float *restrict fields,
    int height, int middle, int rows, int columns, int edge, int pairs)
{
  const int c = (int)get_global_id(0) * LANES, x = (int)get_global_id(1) * LANES;
  if (c >= pairs) return;
  __global const float *re = grid + MARGIN + x, *im = re + (long)rows * columns;
  __global float *zr = fields + c, *zi = zr + (long)edge * pairs;
  fold_pairs(re, im, columns, rows, zr, zi, pairs, edge, x, c, pairs, height, middle);
}
