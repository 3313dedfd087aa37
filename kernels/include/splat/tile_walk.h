/* The walk over (splat, tile) pairs, splat by splat from front to back: what tile_histogram and
 * tile_scatter must agree on.
 *
 * Pairs are numbered in the order of the walk: the splat of rank r has the numbers offsets[r] ..
 * offsets[r+1] - 1, the tiles that it touches row by row. Chunks are cut by pairs and not by splats,
 * so that one splat over the whole image does not hold up one work-item. ranks[r] and owners[r] are
 * what tile_ranks wrote.
 *
 * Each chunk counts its pairs tile by tile in a row of `table` (chunks, tiles) of its own. */

#include "include/vector/chunk.h"
#include "include/splat/tile_spans.h"

/* Where the walk through the cells of a wide splat is: the row's first tile in the box, the bits from
 * this row on, and rows that the cells still have. */
typedef struct {
  int tile, width, across, down, rows;
  ulong bits;
} CellWalk;

static CellWalk walk_of(int4 rank, ulong bits, int tiles_x, int first_tile_row) {
  CellWalk w;
  w.tile = rank.x;
  w.width = rank.y & ((1 << DOWN_BIT) - 1);
  w.down = rank.y >> DOWN_BIT;
  w.across = 0;
  while ((w.width - 1) >> w.across >= SPAN_COLUMNS) w.across++;
  w.rows = (1 << w.down) - ((rank.x / tiles_x + first_tile_row) & ((1 << w.down) - 1));
  w.bits = bits;
  return w;
}

/* The row's run of tiles, from the box's first column on. */
static int2 run_of(const CellWalk *w) {
  const int row = (int)(w->bits & ((1 << SPAN_COLUMNS) - 1));
  const int begin = LOWEST_BIT(row | 1ul << SPAN_COLUMNS) << w->across;
  const int end = (32 - (int)clz(row)) << w->across;
  return (int2)(begin, end < w->width ? end : w->width);
}

static void next_row(CellWalk *w, int tiles_x) {
  w->tile += tiles_x;
  if (--w->rows > 0) return;
  w->bits >>= SPAN_COLUMNS;
  w->rows = 1 << w->down;
}

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

/* VISIT sees `splat`, `tile`, and the pair's `slot`. Only a chunk's first splat may be begun in the
 * middle, after `skip` of its tiles. */
#define FOR_EACH_PAIR(VISIT) \
  const int end = CHUNK_BEGIN(chunk + 1, chunks, pairs); \
  int pair = CHUNK_BEGIN(chunk, chunks, pairs); \
  for (int rank = rank_of(pair, offsets, splats); pair < end; rank++) { \
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
