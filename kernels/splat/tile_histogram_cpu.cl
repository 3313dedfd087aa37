/* Count the entries of every tile, chunk by chunk: the first step of a counting sort by tile.
 *
 *     table[chunk][tile] = (splat, tile) pairs of the chunk
 *
 * Index space: chunks of the walk of include/splat/tile_walk.h.
 *
 * Buffers: ranks[splats, 4], owners[splats, 2], offsets[splats + 1], table[chunks, tiles]. */

#include "include/portable.h"
#include "include/splat/tile_walk.h"

KERNEL void tile_histogram_cpu(
    __global const int4 *restrict ranks, __global const int2 *restrict owners,
    __global const int *restrict offsets, __global int *restrict table, int splats, int pairs,
    int chunks, int tiles, int tiles_x, int first_tile_row)
{
  const int chunk = (int)get_global_id(0);
  if (chunk >= chunks) return;
  __global int *own = table + (long)chunk * tiles;
  for (int tile = 0; tile < tiles; tile++) own[tile] = 0;
  FOR_EACH_PAIR(own[tile]++;)
}
