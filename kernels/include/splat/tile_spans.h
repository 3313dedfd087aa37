/* Which tiles of its box a splat touches, in four ints: what tile_count writes and tile_walk.h reads.
 *
 *     (the box's first tile, its cells, the bits of the first four rows, of the next four)
 *
 * Each of SPAN_ROWS rows has SPAN_COLUMNS bits. Where the box has no more tiles than that, a bit is a
 * tile and the second number is 0. Otherwise it is the box's width, with `down` above it, and a bit is
 * a cell of 2^across columns and 2^down rows. Rows are cut into cells from the image's first row on,
 * whatever rows are listed, so that a tile's list is the same in every band.
 *
 * Ellipses are convex: the bits of a row are one run. */

#define SPAN_ROWS 8
#define SPAN_COLUMNS 8
#define SPAN_ROWS_OF_INT 4
/* Where `down` stands above the box's width. */
#define DOWN_BIT 24
