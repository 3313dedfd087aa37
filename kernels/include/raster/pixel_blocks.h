/* The pixels of one tile as a CPU's work-item holds them: in blocks of 4 x ROWS, whose state a loop
 * over splats can keep in registers.
 *
 * A vector of eight lanes is 4 x 2 pixels: splats are round, or needles at any angle, so that a
 * block this shape wastes fewer lanes than rows of eight (78 % of them are used by a fitted scene,
 * 64 % of 8 x 1). VECTORS of them, one below the other, are a block, which amortises what a block
 * and a splat cost together. It is the same for any number of channels, so that a channel has the
 * same bits alone and among others, and what one launch left in a slot the next can add to. Blocks
 * are numbered down the tile, column of blocks after column.
 *
 * An image has `stride` channels, of which CHANNELS from `first` on are looked at. */

#ifndef VECTORS
#define VECTORS 4
#endif
#define ROWS (2 * VECTORS)
#define ACROSS (TILE / 4)
#define DOWN (TILE / ROWS)
#define BLOCKS (ACROSS * DOWN)
#define SIGN_BIT ((int)0x80000000)

/* The tile's corner in the image, and the image's size. */
typedef struct {
  int x, y, width, height;
} Window;

/* Centres of a block's first vector, counted from the tile's corner; the next is 2 rows below. */
static lanes block_x(int block) {
  return block / DOWN * 4 + (lanes)(0.5f, 1.5f, 2.5f, 3.5f, 0.5f, 1.5f, 2.5f, 3.5f);
}

static lanes block_y(int block) {
  return block % DOWN * ROWS + (lanes)(0.5f, 0.5f, 0.5f, 0.5f, 1.5f, 1.5f, 1.5f, 1.5f);
}

/* A block's pixels that the image has: `across` of each of `down` rows, from pixel `first` on. Lane
 * row % 2 * 4 + column of vector row / 2 holds one. */
typedef struct {
  long first;
  int across, down;
} Rows;

static Rows rows_of(Window window, int block) {
  const int x = window.x + block / DOWN * 4, y = window.y + block % DOWN * ROWS;
  const int right = window.width - x, below = window.height - y;
  const Rows rows = {(long)y * window.width + x, right < 4 ? right : 4, below < ROWS ? below : ROWS};
  return rows;
}

static int any_positive(lanes_int v) {
  const int4 four = v.lo & v.hi;
  const int2 two = four.lo & four.hi;
  return (two.x & two.y) >= 0;
}
