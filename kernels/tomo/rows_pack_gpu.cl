/* Rows of a detector become the columns of a Fourier transform, for GPUs (see
 * include/tomo/row_columns.h).
 *
 * `planes` holds the real parts, (length, columns), then the imaginary ones. Rows begin at `first`;
 * what stands past the last repeats it and is never read. Index space: (bins of 2 length, columns).
 *
 * Buffers: rows[first + count, bins], planes[2, length, columns]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/tomo/row_columns.h"

KERNEL void rows_pack_gpu(
    __global const real *restrict rows, __global real *restrict planes,
    int first, int count, int bins, int length, int columns)
{
  const int b = (int)get_global_id(0) * LANES, c = (int)get_global_id(1) * LANES;
  if (b >= 2 * length) return;
  const int end = b + LANES < 2 * length ? b + LANES : 2 * length;
  __global real *re = planes + c, *im = re + (long)length * columns;
  pack_rows(rows, re, im, columns, first + c, first + count, bins, b, end);
}
