/* The splats that touch each block of a tile (pixel_blocks.h), from packed records, in batches.
 *
 * stage() reads up to BATCH entries of a tile, eight at a time, so that each lane holds one splat.
 * For a strip of four columns it cuts the strip to the ellipse's box, [low, high] about the mean,
 * and has the rows in between from screen_record.h: the highest lies at the column nearest to the
 * ellipse's own highest point, as the bound is concave there, and the lowest likewise. A block
 * counts where its rows of pixel centres meet them. A splat listed too often costs time and
 * nothing else: every pixel asks again. So the bounds only must never be too tight: the root is up
 * to 0.4 % too large, and rows have a hundredth of a pixel to spare.
 *
 * Round j of eight puts entry l * rounds + j on lane l and its answer for a block into bit j of
 * lane l of words[block]. Then the bits of lane 0, 1, .. in order are the entries' order, without
 * a branch for any entry, and counting zeros finds the next. What the loop over pixels wants of an
 * entry lies at place 8 j + l, each number in an array of its own, from which it is broadcast. */

/* Splats whose numbers the loops over pixels hold in cache, a multiple of 8 up to 256. */
#define STAGED_NUMBERS (CHANNELS + MODAL * (16 + MODES(SHAPE_ORDER) + VARIED * MODES(COLOR_ORDER)))
#ifndef BATCH
#define BATCH (STAGED_NUMBERS < 16 ? 256 : STAGED_NUMBERS < 64 ? 64 : STAGED_NUMBERS < 256 ? 32 : 8)
#endif
/* With PACKED all channels of an image are in the splats' records (screen_record.h). */
#ifndef PACKED
#define PACKED 0
#endif
#define PACKED_FEATURES (PACKED ? CHANNELS : 0)
/* Rounds between asking for a splat's record and reading it: splats lie anywhere in memory. */
#define ROUNDS_AHEAD 3
/* Rows that a bound may be off by. */
#define ROW_SLACK 0.01f

typedef struct {
  float x[BATCH], y[BATCH], far[BATCH], lean[BATCH], rise[BATCH], peak[BATCH];
  float feature[CHANNELS][BATCH];
  /* Which of the batch's entries a place holds, and whether it touches any block. */
  int order[BATCH], touched[BATCH];
  lanes_int words[BLOCKS];
#if MODAL
  /* Polynomials in powers, see hermite_modes.h. */
  float shape[BATCH][MODES(SHAPE_ORDER)], color[BATCH][VARIED + 1][MODES(COLOR_ORDER)];
#endif
} Batch;

static lanes smaller_of(lanes a, lanes b) { return a < b ? a : b; }
static lanes larger_of(lanes a, lanes b) { return a > b ? a : b; }

/* sqrt(v), or up to 0.4 % more; at least a thousandth. One step of Newton's from the exponent halved:
 * a built-in root is a call that spills everything on PoCL. */
static lanes root_above(lanes v) {
  v = v > 1e-6f ? v : 1e-6f;
  const lanes guess = AS_LANES(0x5f375a86 - (AS_INT(v) >> 1));
  return v * (guess * (1.503f - 0.5f * v * guess * guess));
}

/* Half the height of an ellipse above its slope, at a column u. */
static lanes height_at(lanes u, lanes reach, lanes per_extent) {
  const lanes share = u * per_extent;
  return reach * root_above(1 - share * share);
}

/* Which blocks the splats of a round touch; `bit` where a lane has one. Any bit is returned. */
static lanes_int touch_blocks(
    lanes_int *words, lanes_int bit, lanes x, lanes y, const lanes *bounds, lanes reach,
    lanes extent, lanes per_extent)
{
  const lanes slope = bounds[0], summit = bounds[1];
  lanes_int any = 0;
  UNROLL for (int strip = 0; strip < ACROSS; strip++) {
    const lanes low = larger_of(4 * strip + 0.5f - x, -extent);
    const lanes high = smaller_of(4 * strip + 3.5f - x, extent);
    const lanes above = smaller_of(larger_of(-summit, low), high);
    const lanes below = smaller_of(larger_of(summit, low), high);
    const lanes top = y + slope * above - height_at(above, reach, per_extent) - ROW_SLACK;
    lanes bottom = y + slope * below + height_at(below, reach, per_extent) + ROW_SLACK;
    bottom = low <= high ? bottom : -1e9f;
    UNROLL for (int row = 0; row < DOWN; row++) {
      const float begin = row * ROWS + 0.5f;
      const lanes_int in = (top <= begin + (ROWS - 1)) & (bottom >= begin) & bit;
      words[strip * DOWN + row] |= in;
      any |= in;
    }
  }
  return any;
}

#if MODAL
#define MODES_PARAMETER __global const float *restrict modes,
#define STAGED_MODES , modes

static void stage_modes(
    Batch *batch, __global const int2 *entries, int places, __global const float *features, int stride,
    __global const float *modes)
{
  for (int place = 0; place < places; place++) {
    if (!batch->touched[place]) continue;
    const long splat = entries[batch->order[place]].x;
    __global const float *mode = modes + splat * ROW, *feature = features + splat * stride;
    turn_into_powers(batch->shape[place], 1, mode + 3, 1, SHAPE_ORDER);
    UNROLL for (int n = 0; n < VARIED; n++)
      turn_into_powers(batch->color[place][n], feature[n], mode + COLOR_MODES + n, COLORED, COLOR_ORDER);
  }
}
#else
#define MODES_PARAMETER
#define STAGED_MODES
#endif

/* Read `count` entries of a tile, of splats with `stride` features of which those from `first` on
 * are wanted. */
static void stage(
    Batch *batch, __global const int2 *entries, int count, Window window,
    __global const float *packed, __global const float *features, int stride, int first
#if MODAL
    , __global const float *modes
#endif
)
{
  const int rounds = (count + 7) / 8;
  const lanes_int owner = (lanes_int)(0, 1, 2, 3, 4, 5, 6, 7) * rounds;
  lanes_int words[BLOCKS];
  for (int block = 0; block < BLOCKS; block++) words[block] = 0;
  for (int round = 0; round < rounds; round++) {
    const int place = 8 * round;
    lanes head[8], tail[8];
    UNROLL for (int lane = 0; lane < 8; lane++) {
      const int at = lane * rounds + round, soon = at + ROUNDS_AHEAD;
      PREFETCH(packed + RECORD_NUMBERS * (long)entries[soon < count ? soon : count - 1].x);
      const long splat = entries[at < count ? at : count - 1].x;
      head[lane] = LOAD(packed + RECORD_NUMBERS * splat);
      tail[lane] = LOAD(packed + RECORD_NUMBERS * splat + 8);
      if (!PACKED_FEATURES)
        for (int n = 0; n < CHANNELS; n++)
          batch->feature[n][place + lane] = features[splat * stride + first + n];
    }
    TRANSPOSE(head)
    TRANSPOSE(tail)
    const lanes x = head[RECORD_X] - window.x, y = head[RECORD_Y] - window.y;
    *(lanes *)&batch->x[place] = x;
    *(lanes *)&batch->y[place] = y;
    *(lanes *)&batch->far[place] = head[RECORD_FAR];
    *(lanes *)&batch->lean[place] = head[RECORD_LEAN];
    *(lanes *)&batch->rise[place] = head[RECORD_RISE];
    *(lanes *)&batch->peak[place] = head[RECORD_PEAK];
    UNROLL for (int n = 0; n < PACKED_FEATURES; n++)
      *(lanes *)&batch->feature[n][place] = tail[RECORD_FEATURE - 8 + n];
    const lanes_int order = owner + round, bit = (order < count) & ((lanes_int)1 << round);
    *(lanes_int *)&batch->order[place] = order;
    *(lanes_int *)&batch->touched[place] = touch_blocks(
        words, bit, x, y, head + RECORD_SLOPE, tail[RECORD_REACH - 8], tail[RECORD_EXTENT - 8],
        tail[RECORD_PER_EXTENT - 8]);
  }
  for (int block = 0; block < BLOCKS; block++) batch->words[block] = words[block];
#if MODAL
  stage_modes(batch, entries, 8 * rounds, features, stride, modes);
#endif
}

/* Places of the batch's entries that touch a block, in order; how many there are is returned. */
static int list_block(const Batch *batch, int block, ushort *list) {
  const uint *words = (const uint *)&batch->words[block];
  int length = 0;
  for (int lane = 0; lane < 8; lane += 2)
    for (ulong bits = words[lane] | (ulong)words[lane + 1] << 32; bits; bits &= bits - 1) {
      const int bit = LOWEST_BIT(bits);
      list[length++] = (ushort)((bit & 31) * 8 + lane + (bit >> 5));
    }
  return length;
}
