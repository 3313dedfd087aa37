/* Find and count the tiles that every splat touches, and make its depth a key that sorts as an
 * unsigned number.
 *
 *     spans[i]  = the tiles that splat i touches, as include/splat/tile_spans.h tells them
 *     counts[i] = tiles that splat i touches, 0 where its depth is NaN;  counts[splats] = 0
 *     keys[i]   = the bits of its depth, flipped so that their order is that of the numbers
 *
 * Boxes of tiles are cut to the tiles_y rows from first_tile_row on, so that none can lead outside of
 * the lists, and counted from there. With ELLIPSES a splat touches the tiles of which its ellipse
 * reaches a pixel centre (include/splat/ellipse_span.h); otherwise all of its box.
 *
 * Of depths the sign bit is flipped, and for negative numbers (an orthographic camera has them) all
 * others too. Both zeros have one key. Only bits are looked at: compilers fold tests for NaN away, and
 * a device may take the smallest numbers for zero.
 *
 * Index space: runs of `run` splats, LANES of them at a time. Where one run is all there is (WHOLE 1),
 * counts become the sums of those before, and total[0] the sum of all.
 *
 * Buffers: boxes[splats, 4], spans[splats, 4], depths, keys[splats], counts[splats + 1], total[1],
 * screen[ELLIPSES ? splats : 0, 8]. */

#include "include/portable.h"
#include "include/splat/splat_rows.h"
#include "include/splat/tile_spans.h"

#ifndef WHOLE
#define WHOLE 0
#endif
#ifndef ELLIPSES
#define ELLIPSES 0
#endif
#if WHOLE
#define TOTAL_PARAMETER , __global long *restrict total
#else
#define TOTAL_PARAMETER
#endif
#if ELLIPSES
#include "include/splat/ellipse_span.h"
#define SCREEN_PARAMETERS , __global const float *restrict screen, float edge
#define ELLIPSE_PARAMETERS , const Ellipse *ellipse, float edge
#define ELLIPSE , ellipse, edge
#else
#define SCREEN_PARAMETERS
#define ELLIPSE_PARAMETERS
#define ELLIPSE
#endif
#define SIGN_BIT ((int)0x80000000)
/* Rows of tiles beyond which no image has any. */
#define MOST_ROWS (1 << 30)

static lanes_int between(lanes_int v, int least, int most) {
  v = v > least ? v : least;
  return v < most ? v : most;
}

static lanes_int sorting_key(lanes depth) {
  lanes_int bits = AS_INT(depth);
  bits = bits == SIGN_BIT ? 0 : bits;
  return bits < 0 ? ~bits : bits ^ SIGN_BIT;
}

/* The least shift for which `most` cells hold all from `first` to `last`. */
static lanes_int cells_of(lanes_int first, lanes_int last, int most) {
  lanes_int shift = 0, more = last - first >= most;
  while (any_lane(more)) {
    shift = more ? shift + 1 : shift;
    more = (last >> shift) - (first >> shift) >= most;
  }
  return shift;
}

/* Boxes that are cut to the tiles that are listed, the end not included, rows counted from the image's
 * first; and the cells that their bits are. */
typedef struct {
  lanes_int x0, y0, x1, y1, across, down;
} Box;

/* Where a box has one tile to a bit in all lanes, which is told when this is compiled, no shifts. */
#define CELLS_RIGHT(v, shift) (single ? (v) : (v) >> (shift))
#define CELLS_LEFT(v, shift) (single ? (v) : (v) << (shift))

/* The bits of the tiles that are touched, and their number; of lanes that are `listed`. */
static lanes_int touched(
    const Box *box, lanes_int listed, const int single, lanes_int *bits ELLIPSE_PARAMETERS)
{
  const lanes_int width = box->x1 - box->x0, cells = CELLS_RIGHT(box->y0, box->down);
#if ELLIPSES
  const lanes left = TO_FLOAT(box->x0), right = TO_FLOAT(box->x1);
#endif
  lanes_int count = 0;
  for (int cell = 0; cell < SPAN_ROWS; cell++) {
    const lanes_int top = CELLS_LEFT(cells + cell, box->down);
    const lanes_int bottom = single ? top + 1 : top + ((lanes_int)1 << box->down);
    const lanes_int here = listed & (top < box->y1);
    if (!any_lane(here)) break;
    lanes_int begin = box->x0, end = box->x1;
#if ELLIPSES
    reached_columns(ellipse, edge, top, bottom, left, right, &begin, &end);
#endif
    const lanes_int some = here & (begin < end);
    begin = CELLS_RIGHT(begin - box->x0, box->across);
    end = CELLS_RIGHT(end - 1 - box->x0, box->across) + 1;
    lanes_int tiles = end - begin;
    if (!single) {
      const lanes_int last = end << box->across;
      tiles = (last < width ? last : width) - (begin << box->across);
      tiles *= (bottom < box->y1 ? bottom : box->y1) - (top > box->y0 ? top : box->y0);
    }
    const lanes_int run = ((lanes_int)1 << end) - ((lanes_int)1 << begin);
    count += some ? tiles : 0;
    bits[cell / SPAN_ROWS_OF_INT] |= (some ? run : 0) << cell % SPAN_ROWS_OF_INT * SPAN_COLUMNS;
  }
  return count;
}

KERNEL void tile_count(
    __global const int *restrict boxes, __global const float *restrict depths,
    __global int *restrict spans, __global int *restrict counts, __global uint *restrict keys,
    int splats, int run, int tiles_x, int first_tile_row, int tiles_y TOTAL_PARAMETER SCREEN_PARAMETERS)
{
  const long from = (long)get_global_id(0) * run;
  const long stop = from + run < splats ? from + run : splats;
  const int end_row = first_tile_row + tiles_y;
  long sum = 0;
  for (long first = from; first < stop; first += LANES) {
    const Rows rows = rows_at(first, stop);
    lanes_int given[4], written[4];
    read_ints(boxes, 4, 0, 4, rows, given);
    const lanes depth = read_numbers(depths, rows);
    const lanes_int above = between(given[1], 0, MOST_ROWS), below = between(given[3], 0, MOST_ROWS);
    Box box;
    box.x0 = between(given[0], 0, tiles_x);
    box.x1 = between(given[2], 0, tiles_x);
    box.y0 = between(above, first_tile_row, end_row);
    box.y1 = between(below, first_tile_row, end_row);
    box.across = box.down = 0;
    const lanes_int width = box.x1 - box.x0, key = sorting_key(depth);
    const lanes_int listed = (width > 0) & (box.y0 < box.y1) & !is_nan(depth);
    const lanes_int wide = (width > SPAN_COLUMNS) | (below - above > SPAN_ROWS);
    written[0] = (box.y0 - first_tile_row) * tiles_x + box.x0;
    written[1] = written[2] = written[3] = 0;
#if ELLIPSES
    lanes numbers[8];
    read_columns(screen, 8, 0, 4, rows, numbers);
    read_columns(screen, 8, 4, 4, rows, numbers + 4);
    const Ellipse shape = ellipse_of(numbers, edge), *ellipse = &shape;
#endif
    lanes_int count;
    if (any_lane(wide)) {
      box.across = cells_of(0, width - 1, SPAN_COLUMNS);
      box.down = cells_of(above, below - 1, SPAN_ROWS);
      written[1] = wide ? width | box.down << DOWN_BIT : 0;
      count = touched(&box, listed, 0, written + 2 ELLIPSE);
    }
    else count = touched(&box, listed, 1, written + 2 ELLIPSE);
    write_ints(spans, 4, 0, 4, rows, written);
    write_ints((__global int *)keys, 1, 0, 1, rows, &key);
#if WHOLE
    for (int lane = 0; lane < rows.count; lane++) {
      counts[first + lane] = (int)sum;
      sum += ((const int *)&count)[lane];
    }
#else
    write_ints(counts, 1, 0, 1, rows, &count);
#endif
  }
  if (from == 0) counts[splats] = (int)sum;
#if WHOLE
  if (from == 0) total[0] = sum;
#endif
}
