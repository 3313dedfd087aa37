/* What the raster's gradient sums of a Gaussian over the pixels of a block, lane by lane.
 *
 * With h = -dL/dsigma at a pixel, S = sum of h, and the same times dx, dy, dx^2, dx dy, dy^2, then
 * w dL/dC of each channel: the record of splat_slots.h up to signs. dx is that of a lane's column,
 * and in vector v of a block dy = dy_0 + 2 v, so that only plain sums are taken vector by vector:
 *
 *     tail_v = h_v + .. + h_last,    rows = sum of v h_v = sum of tail_v from v = 1 on,
 *     squares = sum of v^2 h_v = sum of (2 v - 1) tail_v from v = 1 on,
 *     Sy = dy_0 S + 2 rows,          Syy = dy_0 (dy_0 S + 4 rows) + 4 squares. */

#define MOMENTS 6
#define SUMS RECORD

/* What a splat leaves on a block, before rows are told apart. */
typedef struct {
  lanes h[VECTORS], color[CHANNELS], plain, magnitude_x, magnitude_y;
} BlockSums;

static void clear_sums(BlockSums *b) {
  UNROLL for (int n = 0; n < CHANNELS; n++) b->color[n] = 0;
  b->plain = b->magnitude_x = b->magnitude_y = 0;
}

/* Add the pixels of one vector, of which h = weight dL/dweight and w are known. */
static void add_pixels(
    BlockSums *b, int v, lanes h, lanes w, const lanes *view, const Sight *s, const Batch *batch, int k,
    lanes power, lanes place)
{
  UNROLL for (int n = 0; n < CHANNELS; n++) b->color[n] = b->color[n] + w * view[n];
#if SMOOTH
  b->plain = b->plain + h;
  h = h * falloff_rate(power - s->peak);
#endif
#if ABSGRAD
  /* By the mean: h times the conic times (dx, dy), of which STRETCH^2 is left over. */
  const lanes by_x = batch->far[k] * s->across + batch->lean[k] * s->place;
  b->magnitude_x = b->magnitude_x + absolute(h * by_x);
  b->magnitude_y = b->magnitude_y + absolute(h * (batch->rise[k] * s->place));
#endif
  b->h[v] = h;
}

/* Add a block to the sums of a splat. */
static void add_block(lanes *sums, const BlockSums *b, const Sight *s) {
  lanes tail = b->h[VECTORS - 1], rows = 0, squares = 0;
  UNROLL for (int v = VECTORS - 2; v >= 0; v--) {
    rows = rows + tail;
    squares = squares + (2 * v + 1.0f) * tail;
    tail = tail + b->h[v];
  }
  const lanes by_dx = tail * s->dx, by_dy = s->dy * tail + 2.0f * rows;
  sums[0] = sums[0] + (SMOOTH ? b->plain : tail);
  sums[1] = sums[1] + by_dx;
  sums[2] = sums[2] + by_dy;
  sums[3] = sums[3] + by_dx * s->dx;
  sums[4] = sums[4] + by_dy * s->dx;
  sums[5] = sums[5] + (s->dy * (by_dy + 2.0f * rows) + 4.0f * squares);
  UNROLL for (int n = 0; n < CHANNELS; n++) sums[MOMENTS + n] = sums[MOMENTS + n] + b->color[n];
#if ABSGRAD
  sums[RECORD - 2] = sums[RECORD - 2] + b->magnitude_x * (1 / (STRETCH * STRETCH));
  sums[RECORD - 1] = sums[RECORD - 1] + b->magnitude_y * (1 / (STRETCH * STRETCH));
#endif
}

/* Write a slot; `first` channels were written by launches before this one. */
static void write_slot(__global float *slot, const lanes *sums, int stride, int first) {
  float totals[(RECORD + 7) / 8 * 8] __attribute__((aligned(32)));
  UNROLL for (int n = 0; n + 8 <= RECORD; n += 8) *(lanes *)&totals[n] = sums_of_eight(sums + n);
  UNROLL for (int n = RECORD / 8 * 8; n < RECORD; n++) totals[n] = SUM_OF_LANES(sums[n]);
  UNROLL for (int n = 0; n < RECORD; n++) {
    /* (dx, dy) lead from the mean, in a record to it, and h is -dL/dsigma. */
    const float sum = n < MOMENTS && n != 1 && n != 2 ? -totals[n] : totals[n];
    slot[PLACE(n)] = first > 0 && SHARED(n) ? slot[PLACE(n)] + sum : sum;
  }
}
