/* Transpose planes between the two halves of a Fourier transform.
 *
 *     out[plane][x][y] = source[plane][y][x]
 *
 * Edges are multiples of LANES. Index space: (blocks of LANES columns, blocks of LANES rows, planes),
 * each block transposed in registers.
 *
 * Buffers: source, out[along2, rows, columns]. */

#include "include/portable.h"
#include "include/transpose.h"

KERNEL void fft_transpose(
    __global const float *restrict source, __global float *restrict out, int rows, int columns)
{
  const int x = (int)get_global_id(0) * LANES, y = (int)get_global_id(1) * LANES;
  if (x >= columns) return;
  const long plane = (long)get_global_id(2) * rows * columns;
  lanes block[LANES];
  UNROLL for (int k = 0; k < LANES; k++) block[k] = LOAD(source + plane + (long)(y + k) * columns + x);
  TRANSPOSE(block)
  UNROLL for (int k = 0; k < LANES; k++) STORE(out + plane + (long)(x + k) * rows + y, block[k]);
}
