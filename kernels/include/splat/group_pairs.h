/* A group's way through a chunk of (splat, tile) pairs: what tile_histogram_gpu and tile_scatter_gpu
 * must agree on. See include/splat/tile_pairs.h for the pairs.
 *
 * Each item finds the splat of its pair by bisection, among those that the chunk has pairs of, and
 * then the tile of that splat. */

#include "include/splat/tile_pairs.h"

/* The tile of a pair that `skip` others of its splat come before. */
static int tile_at(int4 rank, int skip, int tiles_x, int first_tile_row) {
  ulong bits = (ulong)(uint)rank.z | (ulong)(uint)rank.w << 32;
  if (rank.y == 0) {
    for (; skip > 0; skip--) bits &= bits - 1;
    const int bit = LOWEST_BIT(bits);
    return rank.x + bit / SPAN_COLUMNS * tiles_x + bit % SPAN_COLUMNS;
  }
  CellWalk w = walk_of(rank, bits, tiles_x, first_tile_row);
  for (int cell = 0; cell < SPAN_ROWS; cell++) {
    const int2 run = run_of(&w);
    const int some = run.y - run.x;
    if (some > 0) {
      const int row = skip / some;
      if (row < w.rows) return w.tile + row * tiles_x + run.x + skip % some;
      skip -= some * w.rows;
    }
    w.tile += w.rows * tiles_x;
    w.bits >>= SPAN_COLUMNS;
    w.rows = 1 << w.down;
  }
  return rank.x;
}

/* The ranks [low, high) that a chunk has pairs of, found by two items for all; `ends` is in local
 * memory. */
static int2 ranks_of_chunk(
    __local int *ends, int item, int begin, int end, __global const int *offsets, int splats)
{
  if (item == 0) ends[0] = rank_of(begin, offsets, 0, splats);
  if (item == GROUP - 1) ends[1] = rank_of(end - 1, offsets, 0, splats) + 1;
  barrier(CLK_LOCAL_MEM_FENCE);
  return (int2)(ends[0], ends[1]);
}
