/* Where each chunk's entries begin within a tile, from where those of its block of chunks do.
 *
 *     table[chunk][tile] = sums[block][tile] + entries that the block's chunks before have in the tile
 *
 * Index space: (tiles, blocks). The sums are those of tile_sums_gpu, after tile_offsets went over them.
 *
 * Buffers: table[chunks, tiles], sums[(chunks + rows - 1) / rows, tiles]. */

#include "include/portable.h"

KERNEL void tile_places_gpu(
    __global int *restrict table, __global const int *restrict sums, int chunks, int tiles, int rows)
{
  const int tile = (int)get_global_id(0), block = (int)get_global_id(1);
  if (tile >= tiles) return;
  const int first = block * rows, stop = rows < chunks - first ? first + rows : chunks;
  int sum = sums[(long)block * tiles + tile];
  for (int chunk = first; chunk < stop; chunk++) {
    const int count = table[(long)chunk * tiles + tile];
    table[(long)chunk * tiles + tile] = sum;
    sum += count;
  }
}
