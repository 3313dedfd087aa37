/* Cells before zero frequency and behind the last one, from the symmetry of a real image's spectrum.
 *
 *     grid[y][-k] = conj grid[-y][k],      grid[y][edge/2 + k] = conj grid[-y][edge/2 - k],
 *
 * k = 1 .. WIDTH, so that a kernel about a sample near either end need not leave its row. Index
 * space: (rows, columns to fill).
 *
 * Buffers: grid[2, rows, columns]. */

#include "include/portable.h"
#include "include/fourier/fourier_rays.h"

KERNEL void spectrum_mirror(__global float *grid, int rows, int columns, int edge)
{
  const int y = (int)get_global_id(0), n = (int)get_global_id(1), k = n / 2 + 1;
  if (y >= rows) return;
  const int from = n % 2 ? edge / 2 - k : k, to = n % 2 ? edge / 2 + k : -k;
  const long plane = (long)rows * columns;
  __global const float *in = grid + (long)(y > 0 ? rows - y : 0) * columns + MARGIN + from;
  __global float *out = grid + (long)y * columns + MARGIN + to;
  out[0] = in[0];
  out[plane] = -in[plane];
}
