/* One level of the sum of a table's rows: every run of RUN rows becomes one row.
 *
 *     sums[run][column] = sum over the run's rows of table[row][column].
 *
 * Applied until one row is left, this is a tree whose shape depends on the number of rows alone,
 * so that the result has the same bits every time. Within a run eight partial sums take turns:
 * they do not wait for each other, and round less. Index space: runs x columns, as one axis.
 *
 * Buffers: table[rows, columns], sums[(rows + RUN - 1) / RUN, columns]. */

#include "include/portable.h"

#ifndef RUN
#define RUN 64
#endif
#define PARTS 8

KERNEL void sum_columns(
    __global const float *restrict table, __global float *restrict sums, int rows, int columns)
{
  const long item = get_global_id(0), run = item / columns;
  if (run * RUN >= rows) return;
  const long row0 = run * RUN;
  const int length = rows - row0 < RUN ? (int)(rows - row0) : RUN;
  __global const float *cell = table + row0 * columns + item % columns;
  float part[PARTS];
  UNROLL for (int k = 0; k < PARTS; k++) part[k] = 0;
  int row = 0;
  for (; row + PARTS <= length; row += PARTS)
    UNROLL for (int k = 0; k < PARTS; k++) part[k] += cell[(long)(row + k) * columns];
  for (int k = 0; row + k < length; k++) part[k] += cell[(long)(row + k) * columns];
  sums[item] = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
}
