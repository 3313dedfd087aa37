/* Count the entries of every tile, chunk by chunk: the first step of a counting sort by tile.
 *
 *     table[chunk][tile] = (splat, tile) pairs of the chunk
 *
 * Index space: GROUP items to each chunk of include/splat/group_pairs.h. See
 * include/vector/equal_keys.h for how the items count together.
 *
 * Buffers: ranks[splats, 4], offsets[splats + 1], table[chunks, tiles]. */

#include "include/portable.h"
#include "include/splat/group_pairs.h"
#include "include/vector/equal_keys.h"

KERNEL void tile_histogram_gpu(
    __global const int4 *restrict ranks, __global const int *restrict offsets,
    __global int *restrict table, int splats, int pairs, int chunks, int tiles, int tiles_x,
    int first_tile_row)
{
  __local int4 keys[GROUP_KEYS];
  __local int ends[2];
  const int chunk = GROUP_NUMBER(0), item = (int)get_local_id(0);
  if (chunk >= chunks) return;
  __global int *own = table + (long)chunk * tiles;
  for (int tile = item; tile < tiles; tile += GROUP) own[tile] = 0;
  const int begin = CHUNK_BEGIN(chunk, chunks, pairs), end = CHUNK_BEGIN(chunk + 1, chunks, pairs);
  const int2 there = ranks_of_chunk(ends, item, begin, end, offsets, splats);
  /* Pairs may be as many as an int tells, and the last group's items stand behind them. */
  for (long first = begin; first < end; first += GROUP) {
    const long pair = first + item;
    int tile = NO_KEY;
    if (pair < end) {
      const int rank = rank_of((int)pair, offsets, there.x, there.y);
      tile = tile_at(ranks[rank], (int)pair - offsets[rank], tiles_x, first_tile_row);
    }
    ((__local int *)keys)[item] = tile;
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    const int2 equal = equal_keys(keys, item, tile);
    if (tile != NO_KEY && equal.x == 0) own[tile] += equal.y;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
