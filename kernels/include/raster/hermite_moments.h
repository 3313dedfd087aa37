/* What the raster's gradient sums of a splat with modes over the pixels of a block, lane by lane.
 *
 * The record of hermite_slots.h, with powers of the place along a column in place of He~_j(u2): a
 * vector adds h v^k and w v_c v^k, He~_i(u1), the same in all rows, comes in once per block, and
 * powers are turned into Hermite polynomials once per slot. */

#define RECORD_LENGTH RECORD
#define SUMS ((RECORD + 7) / 8 * 8)
/* The most powers of a place that a sum has. */
#define SHAPE_POWERS (SHAPE_ORDER + 3)

typedef struct {
  lanes shape[SHAPE_POWERS], color[CHANNELS][COLOR_ORDER + 1];
} BlockSums;

static void clear_sums(BlockSums *b) {
  UNROLL for (int k = 0; k < SHAPE_POWERS; k++) b->shape[k] = 0;
  UNROLL for (int n = 0; n < CHANNELS; n++)
    UNROLL for (int k = 0; k <= COLOR_ORDER; k++) b->color[n][k] = 0;
}

/* Add the pixels of one vector, of which h = dL/dE weight g, with SQUARED times Q, and w are known. */
static void add_pixels(
    BlockSums *b, int v, lanes h, lanes w, const lanes *view, const Sight *s, const Batch *batch, int k,
    lanes power, lanes place)
{
  lanes powers[MOMENT_ORDER + 1];
  powers[1] = place;
  UNROLL for (int n = 2; n <= MOMENT_ORDER; n++) powers[n] = powers[n / 2] * powers[n - n / 2];
  b->shape[0] = b->shape[0] + h;
  UNROLL for (int n = 1; n < SHAPE_POWERS; n++) b->shape[n] = b->shape[n] + h * powers[n];
  UNROLL for (int c = 0; c < CHANNELS; c++) {
    const lanes light = w * view[c];
    b->color[c][0] = b->color[c][0] + light;
    UNROLL for (int n = 1; n <= COLOR_ORDER; n++)
      if (c < VARIED) b->color[c][n] = b->color[c][n] + light * powers[n];
  }
}

/* Add a block to the sums of a splat. */
static void add_block(lanes *sums, const BlockSums *b, const Sight *s) {
  UNROLL for (int i = 0; i < SHAPE_POWERS; i++)
    UNROLL for (int k = 0; k < SHAPE_POWERS; k++)
      if (i + k < SHAPE_POWERS) sums[MODE(i, k)] = sums[MODE(i, k)] + s->he[i] * b->shape[k];
  UNROLL for (int c = 0; c < CHANNELS; c++)
    UNROLL for (int i = 0; i <= COLOR_ORDER; i++)
      UNROLL for (int k = 0; k <= COLOR_ORDER; k++)
        if (i + k <= (c < VARIED ? COLOR_ORDER : 0))
          sums[COLOR_MOMENT(i, k, c)] = sums[COLOR_MOMENT(i, k, c)] + s->he[i] * b->color[c][k];
}

static void write_slot(__global float *slot, const lanes *lane_sums, int stride, int first) {
  float totals[SUMS] __attribute__((aligned(32)));
  UNROLL for (int n = 0; n < SUMS; n += 8) *(lanes *)&totals[n] = sums_of_eight(lane_sums + n);
  UNROLL for (int i = 0; i < SHAPE_POWERS; i++)
    UNROLL for (int j = 0; j < SHAPE_POWERS; j++) {
      if (i + j >= SHAPE_POWERS) continue;
      float sum = 0;
      UNROLL for (int down = 0; down < SHAPE_POWERS; down += 2)
        if (down <= j) sum += IN_POWERS[j][j - down] * totals[MODE(i, j - down)];
      slot[MODE(i, j)] = sum;
    }
  UNROLL for (int c = 0; c < CHANNELS; c++)
    UNROLL for (int i = 0; i <= COLOR_ORDER; i++)
      UNROLL for (int j = 0; j <= COLOR_ORDER; j++) {
        if (i + j > (c < VARIED ? COLOR_ORDER : 0)) continue;
        float sum = 0;
        UNROLL for (int down = 0; down <= COLOR_ORDER; down += 2)
          if (down <= j) sum += IN_POWERS[j][j - down] * totals[COLOR_MOMENT(i, j - down, c)];
        slot[COLOR_MOMENT(i, j, c)] = sum;
      }
}
