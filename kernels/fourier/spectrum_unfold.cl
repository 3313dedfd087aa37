/* Between the two halves of the transform: the spectra of a pair of image rows are told apart.
 *
 *     R1 = (Z[x] + conj Z[-x]) / 2,      R2 = (Z[x] - conj Z[-x]) / 2i,
 *
 * which is the transpose of spectrum_fold_gpu for spectra of real rows. Rows of the grid that no image
 * row stands in, and columns before zero and behind the last frequency, become zero.
 *
 * Index space: (blocks of LANES columns of the grid, blocks of LANES rows).
 *
 * Buffers: fields[2, edge, pairs], grid[2, rows, columns]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"

KERNEL void spectrum_unfold(
    __global const float *restrict fields, __global float *restrict grid,
    int height, int middle, int rows, int columns, int edge, int pairs)
{
  const int column = (int)get_global_id(0) * LANES, y = (int)get_global_id(1) * LANES;
  if (column >= columns) return;
  const int x = column - MARGIN;
  const int c = y % pairs, second = y >= pairs;
  lanes re[LANES], im[LANES];
  UNROLL for (int k = 0; k < LANES; k++) {
    re[k] = im[k] = 0;
    if (x + k < 0 || x + k > edge / 2 || y >= 2 * pairs) continue;
    __global const float *here = fields + (long)(x + k) * pairs + c;
    __global const float *there = fields + (long)(x + k > 0 ? edge - x - k : 0) * pairs + c;
    const lanes ar = LOAD(here), ai = LOAD(here + (long)edge * pairs);
    const lanes br = LOAD(there), bi = LOAD(there + (long)edge * pairs);
    re[k] = 0.5f * (second ? ai + bi : ar + br);
    im[k] = 0.5f * (second ? br - ar : ai - bi);
  }
  TRANSPOSE(re)
  TRANSPOSE(im)
  for (int k = 0; k < LANES; k++) {
    if (y + k >= rows) continue;
    const int image_row = y + k < height;
    const int row = y + k < middle ? y + k - middle + rows : y + k - middle;
    __global float *out = grid + (long)row * columns + column;
    STORE(out, image_row ? re[k] : (lanes)0);
    STORE(out + (long)rows * columns, image_row ? im[k] : (lanes)0);
  }
}
