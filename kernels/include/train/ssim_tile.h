/* The window of SSIM on tiles of an image: 11 Gaussian taps of sigma 1.5, down and then along.
 *
 * An image is taken as rows of floats in which the CHANNELS of a pixel stand side by side, so that
 * neighbours along a row are CHANNELS floats apart and one vector load serves all channels. A
 * group makes a tile of ROWS rows and STRIP floats: it blurs down, LANES columns at a time with
 * ROWS sums in registers, into local memory, HALO columns beyond the tile on both sides, and then
 * along from there. What is in between never leaves the cache. A row's last block begins LANES
 * floats before its end, so that no load needs a margin.
 *
 * Borders are mirrored between pixels, c b a | a b c. A symmetric window mirrored so is its own
 * adjoint: the weight of j in the mean at i is g(i - j) + g(i + j + 1) + g(i + j + 1 - 2 n). */

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef IMAGE_CHANNELS
#define IMAGE_CHANNELS CHANNELS
#endif
#ifndef ROWS
#define ROWS 4
#endif
#ifndef STRIP
#define STRIP 256
#endif
#ifndef WEIGHTED
#define WEIGHTED 0
#endif
#define RADIUS 5
#define HALO ((RADIUS * CHANNELS + LANES - 1) / LANES * LANES)
#define SPAN (STRIP + 2 * HALO)

#if GROUP > 1
#define WAIT barrier(CLK_LOCAL_MEM_FENCE);
#else
#define WAIT
#endif

#if LANES == 8 && RIFT_POCL
#define LOAD_LOCAL(p) (*(const __local lanes_at *)(p))
#define STORE_LOCAL(p, v) (*(__local lanes_at *)(p) = (v))
#elif LANES == 8
#define LOAD_LOCAL(p) vload8(0, p)
#define STORE_LOCAL(p, v) vstore8(v, 0, p)
#else
#define LOAD_LOCAL(p) (*(p))
#define STORE_LOCAL(p, v) (*(p) = (v))
#endif

/* The taps at distances 0 to RADIUS; the eleven add up to one. */
__constant float TAPS[RADIUS + 1] = {
    0.266011715f, 0.213005543f, 0.109360687f, 0.0360007733f, 0.00759875821f, 0.00102838012f};

#define TAP(k) TAPS[(k) < 0 ? -(k) : (k)]

/* Add row `r` of the ROWS + 2 RADIUS that are blurred down to the sums of the tile's rows. */
static void add_row(lanes *sums, int r, lanes v) {
  UNROLL for (int o = 0; o < ROWS; o++) {
    if (r >= o && r - o <= 2 * RADIUS) sums[o] = sums[o] + TAP(r - o - RADIUS) * v;
  }
}

static lanes blurred_along(const __local float *p) {
  lanes sum = 0;
  UNROLL for (int k = -RADIUS; k <= RADIUS; k++) sum = sum + TAP(k) * LOAD_LOCAL(p + k * CHANNELS);
  return sum;
}

/* A row mirrored into 0 .. height - 1; rows that no result needs are held there. */
static int mirrored(int row, int height) {
  row = row < 0 ? -1 - row : row;
  row = row >= height ? 2 * height - 1 - row : row;
  return row < 0 ? 0 : row;
}

/* Mirror a row of a tile, whose own floats begin at `row` + HALO and are number `first` of the
 * image's `width`, into what of the margin lies outside the image. */
static void mirror_ends(__local float *row, int first, int width) {
  const int end = width - first + HALO;
  for (int k = (int)get_local_id(0); k < RADIUS * CHANNELS; k += GROUP) {
    const int before = k - 2 * (k / CHANNELS * CHANNELS) - CHANNELS;
    if (first == 0) row[HALO + before] = row[HALO + k];
    if (end + k < SPAN) row[end + k] = row[end + before];
  }
}

/* Where in its row an image has LANES floats that begin at f of CHANNELS a pixel. */
static lanes_int image_places(int f, int width) {
  lanes_int at = f + TO_INT(LANE_NUMBERS);
  at = at < width ? at : width - 1;
  return at + at / CHANNELS * (IMAGE_CHANNELS - CHANNELS);
}

/* LANES floats of a row from f on; those past its end repeat the last one. */
static lanes load_row(__global const float *row, int f, int width) {
  if (f + LANES <= width) return LOAD(row + f);
  lanes_int at = f + TO_INT(LANE_NUMBERS);
  at = at < width ? at : width - 1;
  return GATHER(row, at);
}

/* The same of an image that may have more channels than count. */
static lanes load_image(__global const float *row, int f, int width) {
  if (IMAGE_CHANNELS == CHANNELS) return load_row(row, f, width);
  const lanes_int at = image_places(f, width);
  return GATHER(row, at);
}

/* The weights of the pixels that LANES floats from f on belong to. */
static lanes load_weights(__global const float *row, int f, int width) {
  lanes_int at = f + TO_INT(LANE_NUMBERS);
  at = (at < width ? at : width - 1) / CHANNELS;
  return GATHER(row, at);
}
