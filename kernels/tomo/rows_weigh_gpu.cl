/* Multiply the spectra of real rows by responses, for GPUs (see include/tomo/row_columns.h).
 *
 * Each filter serves `rows_per_filter` rows. Index space: (blocks of LANES columns, length / 2 + 1).
 *
 * Buffers: planes[2, length, columns], sums, differences[length / 2 + 1, filters],
 * half_turns[length / 2 + 1, 2]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/tomo/row_columns.h"

KERNEL void rows_weigh_gpu(
    __global real *restrict planes, __global const real *restrict sums,
    __global const real *restrict differences, __global const real *restrict half_turns,
    int first, int rows_per_filter, int filters, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, k = (int)get_global_id(1);
  if (c >= columns) return;
  int index[LANES];
  filters_of(first + c, rows_per_filter, filters, index);
  __global real *re = planes + c, *im = re + (long)length * columns;
  weigh_rows(re, im, columns, k, length, sums, differences, half_turns, filters, index);
}
