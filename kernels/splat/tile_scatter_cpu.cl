/* Write the tiles' lists: the last step of a counting sort by tile.
 *
 *     entries[starts[tile] ..] = (splat, slot) of the tile's splats, front to back
 *
 * A slot is the splat's first slot plus the tile's place among those that it touches: a number that no
 * other entry has, and a splat's own are side by side. `table` holds how many entries of the tile come from
 * the chunks before.
 *
 * Index space: chunks of the walk of include/splat/tile_walk.h.
 *
 * Buffers: ranks[splats, 4], owners[splats, 2], offsets[splats + 1], table[chunks, tiles],
 * starts[tiles], entries[pairs, 2]. */

#include "include/portable.h"
#include "include/splat/tile_walk.h"

KERNEL void tile_scatter_cpu(
    __global const int4 *restrict ranks, __global const int2 *restrict owners,
    __global const int *restrict offsets, __global int *restrict table, __global const int *restrict starts,
    __global int2 *restrict entries, int splats, int pairs, int chunks, int tiles, int tiles_x,
    int first_tile_row)
{
  const int chunk = (int)get_global_id(0);
  if (chunk >= chunks) return;
  __global int *own = table + (long)chunk * tiles;
  FOR_EACH_PAIR(entries[starts[tile] + own[tile]++] = (int2)(splat, slot);)
}
