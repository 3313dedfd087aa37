/* Between the two halves of the inverse transform: two real image rows share one complex row.
 *
 * After the transform along y, row y of the grid is the half spectrum R of a real image row. With
 * the rows of a pair, Z = R1 + i R2 has R1's row as the real part of its transform and R2's as the
 * imaginary one; the other half of Z is conj R1 + i conj R2. Pairs stand along the lanes, so that
 * the next transform runs down the columns:
 *
 *     fields[x][c] = R1 + i R2,  fields[edge - x][c] = conj R1 + i conj R2,  rows c and c + columns.
 *
 * Image row c is row (c - middle) of the periodic grid. Index space: (blocks of LANES pairs, blocks
 * of LANES frequencies 0 .. edge / 2). */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier_rays.h"

static lanes row_of(__global const float *grid, int c, int height, int middle, int rows, int columns) {
  if (c >= height) return 0;
  return LOAD(grid + (long)(c >= middle ? c - middle : c - middle + rows) * columns);
}

KERNEL void spectrum_fold(
    __global const float *restrict grid, __global float *restrict fields,
    int height, int middle, int rows, int columns, int edge, int pairs)
{
  const int c = (int)get_global_id(0) * LANES, x = (int)get_global_id(1) * LANES;
  if (c >= pairs) return;
  __global const float *re = grid + MARGIN + x, *im = re + (long)rows * columns;
  lanes ar[LANES], ai[LANES], br[LANES], bi[LANES];
  UNROLL for (int k = 0; k < LANES; k++) {
    ar[k] = row_of(re, c + k, height, middle, rows, columns);
    ai[k] = row_of(im, c + k, height, middle, rows, columns);
    br[k] = row_of(re, c + k + pairs, height, middle, rows, columns);
    bi[k] = row_of(im, c + k + pairs, height, middle, rows, columns);
  }
  TRANSPOSE(ar)
  TRANSPOSE(ai)
  TRANSPOSE(br)
  TRANSPOSE(bi)
  UNROLL for (int k = 0; k < LANES; k++) {
    if (x + k > edge / 2) continue;
    __global float *here = fields + (long)(x + k) * pairs + c;
    STORE(here, ar[k] - bi[k]);
    STORE(here + (long)edge * pairs, ai[k] + br[k]);
    if (x + k == 0 || x + k == edge / 2) continue;
    __global float *there = fields + (long)(edge - x - k) * pairs + c;
    STORE(there, ar[k] + bi[k]);
    STORE(there + (long)edge * pairs, br[k] - ai[k]);
  }
}
