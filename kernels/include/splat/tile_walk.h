/* The walk of one work-item over a chunk of (splat, tile) pairs: what tile_histogram_cpu and
 * tile_scatter_cpu must agree on. See include/splat/tile_pairs.h for the pairs. */

#include "include/splat/tile_pairs.h"

/* VISIT sees `splat`, `tile`, and the pair's `slot`. Only a chunk's first splat may be begun in the
 * middle, after `skip` of its tiles. */
#define FOR_EACH_PAIR(VISIT) \
  const int end = CHUNK_BEGIN(chunk + 1, chunks, pairs); \
  int pair = CHUNK_BEGIN(chunk, chunks, pairs); \
  for (int rank = rank_of(pair, offsets, 0, splats); pair < end; rank++) { \
    const int last = offsets[rank + 1] < end ? offsets[rank + 1] : end, splat = owners[rank].y; \
    const int4 tiles_of = ranks[rank]; \
    int skip = pair - offsets[rank], slot = owners[rank].x + skip; \
    ulong bits = (ulong)(uint)tiles_of.z | (ulong)(uint)tiles_of.w << 32; \
    if (tiles_of.y == 0) { \
      for (; skip > 0; skip--) bits &= bits - 1; \
      for (; pair < last; pair++, slot++, bits &= bits - 1) { \
        const int bit = LOWEST_BIT(bits); \
        const int tile = tiles_of.x + bit / SPAN_COLUMNS * tiles_x + bit % SPAN_COLUMNS; \
        VISIT \
      } \
      continue; \
    } \
    for (CellWalk walk = walk_of(tiles_of, bits, tiles_x, first_tile_row); pair < last; \
         next_row(&walk, tiles_x)) { \
      const int2 run = run_of(&walk); \
      const int some = run.y - run.x > 0 ? run.y - run.x : 0, from = skip < some ? skip : some; \
      skip -= from; \
      for (int tile = walk.tile + run.x + from; tile < walk.tile + run.y && pair < last; \
           pair++, tile++, slot++) { \
        VISIT \
      } \
    } \
  }
