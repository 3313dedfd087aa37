/* Sum blocks of a table's rows, so that its columns are summed by many items: see tile_offsets.
 *
 *     sums[block][tile] = sum of table[block * rows][tile] .. table[block * rows + rows - 1][tile]
 *
 * Index space: (tiles, blocks).
 *
 * Buffers: table[chunks, tiles], sums[(chunks + rows - 1) / rows, tiles]. */

#include "include/portable.h"

KERNEL void tile_sums_gpu(
    __global const int *restrict table, __global int *restrict sums, int chunks, int tiles, int rows)
{
  const int tile = (int)get_global_id(0), block = (int)get_global_id(1);
  if (tile >= tiles) return;
  const int first = block * rows, stop = rows < chunks - first ? first + rows : chunks;
  int sum = 0;
  for (int chunk = first; chunk < stop; chunk++) sum += table[(long)chunk * tiles + tile];
  sums[(long)block * tiles + tile] = sum;
}
