/* Copy some columns of one table into another.
 *
 *     to[row][to_first + k] = from[row][from_first + k]   for k < columns
 *
 * Index space: (rows). Tables are (rows, from_width) and (rows, to_width). */

#include "include/portable.h"

KERNEL void copy_columns(
    __global const float *restrict from, __global float *restrict to, int rows, int columns,
    int from_width, int from_first, int to_width, int to_first)
{
  const long row = get_global_id(0);
  if (row >= rows) return;
  for (int k = 0; k < columns; k++)
    to[row * to_width + to_first + k] = from[row * from_width + from_first + k];
}
