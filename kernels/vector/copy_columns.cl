/* Copy some columns of one table into another.
 *
 *     target[row][target_first + k] = source[row][source_first + k]   for k < columns
 *
 * Index space: (rows). Tables are (rows, source_width) and (rows, target_width).
 *
 * Buffers: source[(rows - 1) * source_width + source_first + columns],
 * target[(rows - 1) * target_width + target_first + columns]. */

#include "include/portable.h"

KERNEL void copy_columns(
    __global const float *restrict source, __global float *restrict target, int rows, int columns,
    int source_width, int source_first, int target_width, int target_first)
{
  const long row = get_global_id(0);
  if (row >= rows) return;
  for (int k = 0; k < columns; k++)
    target[row * target_width + target_first + k] = source[row * source_width + source_first + k];
}
