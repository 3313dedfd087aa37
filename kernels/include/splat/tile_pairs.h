/* The (splat, tile) pairs that a counting sort by tile goes through, splat by splat from front to back.
 *
 * The splat of rank r has the numbers offsets[r] .. offsets[r+1] - 1, the tiles that it touches row by
 * row. Chunks are cut by pairs and not by splats, so that one splat over the whole image does not hold
 * up one chunk. ranks[r] and owners[r] are what tile_ranks wrote.
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

/* The last rank of [low, high) whose pairs begin at `pair` or before; ranks without pairs are passed
 * over. */
static int rank_of(int pair, __global const int *offsets, int low, int high) {
  while (high - low > 1) {
    const int middle = low + (high - low) / 2;
    if (offsets[middle] <= pair) low = middle;
    else high = middle;
  }
  return low;
}
