/* The columns of a Fourier transform become rows of a detector again, for GPUs: rows_pack_gpu.cl backwards.
 *
 * Index space: (blocks of LANES bins, blocks of LANES rows).
 *
 * Buffers: planes[2, length, columns], rows[first + count, bins],
 * gains[(first + count + rows_per_view - 1) / rows_per_view]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/tomo/row_columns.h"

KERNEL void rows_unpack_gpu(
    __global const real *restrict planes, __global real *restrict rows, __global const real *restrict gains,
    int first, int count, int rows_per_view, int bins, int length, int columns)
{
  const int b = (int)get_global_id(0) * LANES, c = (int)get_global_id(1) * LANES;
  if (b >= bins) return;
  const int end = b + LANES < bins ? b + LANES : bins;
  __global const real *re = planes + c, *im = re + (long)length * columns;
  unpack_rows(re, im, columns, rows, gains, first + c, first + count, rows_per_view, bins, b, end);
}
