/* A tile of the image as a group of a GPU works on it: its pixels in blocks, its entries in batches.
 *
 * A group has GROUP items, one for each pixel of a part of the tile; a tile of 16 x 16 pixels is one
 * part for a group of 256. 32 pixels, 8 x 4 of them, are a block, which is what the items of a
 * sub-group see. Blocks are numbered in Morton's order (the even bits of a pixel's number are the
 * column, the odd ones the row), so that any 2^n pixels from a multiple of 2^n on are a square or two
 * squares side by side, whatever the group; within a block pixels are numbered row by row.
 *
 * Why blocks: splats fitted to photographs are needles, which touch few of the pixels of a tile in
 * whose list they stand. The item that fetches an entry into local memory therefore says with one bit
 * for each block whether the splat's ellipse reaches it; a block then takes the entries with its bit
 * alone. The test is exact but for a margin, and is made once per entry and block.
 *
 * With include/raster/screen_record.h, of a splat at (x, y) and a strip of columns between centres
 * left and right of the mean, u in [low, high] is the strip cut to [-ex, ex]. The ellipse's upper
 * edge falls to both sides of u = -summit and its lower edge to both sides of u = summit, so the
 * highest and the lowest row within the strip are those edges at -summit and summit, held within
 * [low, high]. A block of the strip is touched if its rows of centres overlap what lies between. */

#ifndef TILE
#define TILE 16
#endif
#define PARTS (TILE * TILE / GROUP)
#define BLOCK (GROUP < 32 ? GROUP : 32)
#define BLOCKS (GROUP / BLOCK)
#define BLOCK_WIDTH (BLOCK >= 32 ? 8 : BLOCK >= 8 ? 4 : BLOCK >= 2 ? 2 : 1)
#define BLOCK_HEIGHT (BLOCK / BLOCK_WIDTH)
/* Blocks side by side and above each other in a part. */
#define STRIPS (BLOCKS >= 4 ? 2 : 1)
#define LEVELS (BLOCKS / STRIPS)
/* Entries that are in local memory at a time, in 12 KiB at most: a multiple of 32. */
#ifndef BATCH
#define BATCH (QUADS <= 3 ? 256 : QUADS <= 6 ? 128 : 64)
#endif
#define WORDS (BATCH / 32)
/* A loop whose turns side by side would take more registers than they save time. */
#define ROLLED _Pragma("unroll 1")
/* What rounding may take off an edge: of a pixel, and of the numbers that it is the sum of. */
#define SLACK 0.01f
#define SHARE_OF_SLACK 1e-6f

/* The even bits of a number below 1024, closed up. */
static int even_bits(int v) {
  v &= 0x155;
  v = (v | v >> 1) & 0x133;
  v = (v | v >> 2) & 0x10f;
  return (v | v >> 4) & 0x1f;
}

#define COLUMN_OF(pixel) (even_bits((pixel) / BLOCK * BLOCK) + (pixel) % BLOCK_WIDTH)
#define ROW_OF(pixel) (even_bits((pixel) / BLOCK * BLOCK >> 1) + (pixel) % BLOCK / BLOCK_WIDTH)
/* The block of a strip and a level, in the same order. */
#define BLOCK_AT(strip, level) (((level) & 1) | (strip) << 1 | ((level) >> 1) << 2)

static float larger_of(float a, float b) { return a > b ? a : b; }
static float smaller_of(float a, float b) { return a < b ? a : b; }

/* How far an ellipse's edge lies from its axis at column u, as a share of what it does at u = 0; a
 * little more, against rounding. */
static float half_height(float u, float per_extent) {
  const float share = u * per_extent, rest = 1 - share * share;
  return 1.001f * sqrt(larger_of(rest, 1e-6f));
}

/* A bit for each block of a part that a splat's ellipse reaches; (x, y) counts from the part's corner.
 * What is no number reaches every block. */
static uint blocks_reached(
    float x, float y, float slope, float summit, float reach, float extent, float per_extent)
{
  uint bits = 0;
  ROLLED for (int strip = 0; strip < STRIPS; strip++) {
    const float left = strip * BLOCK_WIDTH + 0.5f - x, right = left + (BLOCK_WIDTH - 1);
    const float low = larger_of(left, -extent), high = smaller_of(right, extent);
    const float up = smaller_of(larger_of(-summit, low), high);
    const float down = smaller_of(larger_of(summit, low), high);
    const float above = reach * half_height(up, per_extent), below = reach * half_height(down, per_extent);
    const float slack = SLACK + SHARE_OF_SLACK * (reach + fabs(slope) * larger_of(fabs(up), fabs(down)));
    const float top = y + slope * up - above - slack, bottom = y + slope * down + below + slack;
    UNROLL for (int level = 0; level < LEVELS; level++) {
      const float first = level * BLOCK_HEIGHT + 0.5f;
      const int missed = low > high || top > first + (BLOCK_HEIGHT - 1) || bottom < first;
      bits |= missed ? 0u : 1u << BLOCK_AT(strip, level);
    }
  }
  return bits;
}

/* Bit `which` of four bytes, as four bits in the bytes' order. */
static uint bit_of_four(uint bytes, int which) {
  return ((bytes >> which & 0x01010101u) * 0x01020408u) >> 24 & 15u;
}

/* Bit `which` of 32 bytes in local memory. */
static uint bit_of_bytes(__local const uint *bytes, int which) {
  uint word = 0;
  UNROLL for (int n = 0; n < 8; n++) word |= bit_of_four(bytes[n], which) << 4 * n;
  return word;
}

/* A bit for each of 32 bytes in local memory that is not 0. */
static uint any_of_bytes(__local const uint *bytes) {
  uint word = 0;
  UNROLL for (int n = 0; n < 8; n++) {
    uint four = bytes[n];
    four |= four >> 4 & 0x0f0f0f0fu;
    four |= four >> 2 & 0x03030303u;
    four |= four >> 1 & 0x01010101u;
    word |= bit_of_four(four, 0) << 4 * n;
  }
  return word;
}

/* Number of the lowest bit that is set. */
static int lowest_bit(uint word) { return 31 - (int)clz(word & (0u - word)); }
