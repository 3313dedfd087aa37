/* The walk over (splat, tile) pairs, splat by splat from front to back: what tile_histogram and
 * tile_scatter must agree on.
 *
 * Pairs are numbered in the order of the walk: the splat of rank r has the numbers offsets[r] ..
 * offsets[r+1] - 1, the tiles of its box row by row. Chunks are cut by pairs and not by splats,
 * so that one splat over the whole image does not hold up one work-item. ranks[r] is what
 * tile_ranks wrote.
 *
 * Each chunk counts its pairs tile by tile in a row of `table` (chunks, tiles) of its own. */

#include "include/vector/chunk.h"

/* The last rank whose pairs begin at `pair` or before; ranks without pairs are passed over. */
static int rank_of(int pair, __global const int *offsets, int splats) {
  int low = 0, high = splats;
  while (high - low > 1) {
    const int middle = low + (high - low) / 2;
    if (offsets[middle] <= pair) low = middle;
    else high = middle;
  }
  return low;
}

/* VISIT sees `splat`, `tile`, and the pair's `slot`. */
#define FOR_EACH_PAIR(VISIT) \
  const int end = CHUNK_BEGIN(chunk + 1, chunks, pairs); \
  int pair = CHUNK_BEGIN(chunk, chunks, pairs); \
  for (int rank = rank_of(pair, offsets, splats); pair < end; rank++) { \
    const int last = offsets[rank + 1] < end ? offsets[rank + 1] : end; \
    const int corner = ranks[rank].x, width = ranks[rank].y, splat = ranks[rank].w; \
    const int number = pair - offsets[rank]; \
    /* Only a chunk's first splat may be begun in the middle, and divisions are slow. */ \
    const int row = number ? number / width : 0; \
    int column = number - row * width; \
    int tile = corner + row * tiles_x + column; \
    int slot = ranks[rank].z + number; \
    for (; pair < last; pair++, tile++, slot++) { \
      VISIT \
      if (++column == width) { column = 0; tile += tiles_x - width; } \
    } \
  }
