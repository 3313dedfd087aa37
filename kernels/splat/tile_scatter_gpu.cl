/* Write the tiles' lists: the last step of a counting sort by tile.
 *
 *     entries[starts[tile] ..] = (splat, slot) of the tile's splats, front to back
 *
 * A slot is the splat's first slot plus the tile's place among those that it touches: a number that no
 * other entry has, and a splat's own are side by side. `table` holds how many entries of the tile come from
 * the chunks before.
 *
 * Index space: GROUP items to each chunk of include/splat/group_pairs.h. See
 * include/vector/equal_keys.h for how the items find their places.
 *
 * Buffers: ranks[splats, 4], owners[splats, 2], offsets[splats + 1], table[chunks, tiles],
 * starts[tiles], entries[pairs, 2]. */

#include "include/portable.h"
#include "include/splat/group_pairs.h"
#include "include/vector/equal_keys.h"

KERNEL void tile_scatter_gpu(
    __global const int4 *restrict ranks, __global const int2 *restrict owners,
    __global const int *restrict offsets, __global int *restrict table, __global const int *restrict starts,
    __global int2 *restrict entries, int splats, int pairs, int chunks, int tiles, int tiles_x,
    int first_tile_row)
{
  __local int4 keys[GROUP_KEYS];
  __local int ends[2];
  const int chunk = GROUP_NUMBER(0), item = (int)get_local_id(0);
  if (chunk >= chunks) return;
  __global int *own = table + (long)chunk * tiles;
  const int begin = CHUNK_BEGIN(chunk, chunks, pairs), end = CHUNK_BEGIN(chunk + 1, chunks, pairs);
  const int2 there = ranks_of_chunk(ends, item, begin, end, offsets, splats);
  /* Pairs may be as many as an int tells, and the last group's items stand behind them. */
  for (long first = begin; first < end; first += GROUP) {
    const long pair = first + item;
    int tile = NO_KEY;
    int2 entry = (int2)(0, 0);
    if (pair < end) {
      const int rank = rank_of((int)pair, offsets, there.x, there.y);
      const int skip = (int)pair - offsets[rank];
      tile = tile_at(ranks[rank], skip, tiles_x, first_tile_row);
      entry = (int2)(owners[rank].y, owners[rank].x + skip);
    }
    ((__local int *)keys)[item] = tile;
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    const int2 equal = equal_keys(keys, item, tile);
    const int place = tile != NO_KEY ? own[tile] : 0;
    if (tile != NO_KEY) entries[starts[tile] + place + equal.x] = entry;
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    if (tile != NO_KEY && equal.x == 0) own[tile] = place + equal.y;
  }
}
