/* Factors of the cubic B-splines through the samples of images, along one of their axes:
 *
 *     factors[k] = sqrt(3) * sum over n of z^|n| samples[k + n],   z = sqrt(3) - 2
 *
 * (M. Unser, A. Aldroubi and M. Eden, IEEE Trans. Signal Process. 41, 821, 1993), samples beyond an
 * image's ends being zero. The sum ends where z^|n| is 1e-8. It is symmetric, and so its own
 * transpose. With DOWN 1 the axis runs down the columns, with 0 along the rows.
 *
 * Index space: (runs of LANES columns, rows, images).
 *
 * Buffers: factors, samples[along2, rows, columns]. */

#include "include/portable.h"

#ifndef DOWN
#define DOWN 0
#endif
#define POLE ((real)-0.26794919243112270647)
#define GAIN ((real)1.73205080756887729353)
/* Samples to either side. */
#define REACH 13

/* LANES samples of a row from the k-th on, zeros where there are none. */
static lanes some(__global const real *row, int k, int columns) {
  if (k >= 0 && k + LANES <= columns) return LOAD(row + k);
  lanes found = 0;
  for (int n = 0; n < LANES; n++)
    if (k + n >= 0 && k + n < columns) ((real *)&found)[n] = row[k + n];
  return found;
}

/* The sum over n > 0 on one side, from its far end on. */
static lanes beside(__global const real *image, int row, int column, int rows, int columns, int step) {
  lanes sum = 0;
  for (int n = REACH; n > 0; n--) {
    const int i = DOWN ? row + n * step : row, k = DOWN ? column : column + n * step;
    const int there = i >= 0 && i < rows;
    sum = POLE * (sum + (there ? some(image + (long)i * columns, k, columns) : (lanes)0));
  }
  return sum;
}

KERNEL void spline_coefficients(
    __global real *restrict factors, __global const real *restrict samples, int rows, int columns)
{
  const int k0 = (int)get_global_id(0) * LANES, i = (int)get_global_id(1);
  if (k0 >= columns) return;
  const long image = (long)get_global_id(2) * rows * columns;
  const lanes here = some(samples + image + (long)i * columns, k0, columns);
  const lanes sum = here + (beside(samples + image, i, k0, rows, columns, 1) +
                            beside(samples + image, i, k0, rows, columns, -1));
  __global real *out = factors + image + (long)i * columns + k0;
  const lanes found = GAIN * sum;
  if (k0 + LANES <= columns) {
    STORE(out, found);
    return;
  }
  for (int n = 0; k0 + n < columns; n++) out[n] = ((const real *)&found)[n];
}
