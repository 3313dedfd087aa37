/* How far a splat with Hermite modes reaches on the screen, before its modes are projected.
 *
 * With c_n the modes of order n, whose 2-norm projection never raises, and K_n(u) the sum over
 * |m| = n of He~_m(u)^2, which depends on r = |u| alone, Cauchy and Schwarz bound the splat by
 *
 *     B(r) = weight P(r) exp(-r^2 / 2),     P(r) = 1 + sum over n of |c_n| sqrt(K_n(r)),
 *
 * with P squared where the activation squares. What is drawn ends where B does: at the largest r
 * with 255 B(r) = 1. From MOST_RADIUS inwards, r <- sqrt(2 ln(255 weight P(r))) falls to it and
 * never below, as long as P(r) is no less than P of any smaller r. That holds from STEADY_RADIUS
 * on for orders up to 8 (found by tabulating K_n; even orders dip near the middle). So every step
 * gives a radius beyond which nothing is drawn; few are enough. If 255 weight P <= 1 the splat is
 * too faint everywhere.
 *
 * Sums of line integrals, which no display rounds, end where include/raster/hermite_edge.h says,
 * and SMOOTH cut-offs at MOST_RADIUS. A colour's polynomial widens nothing where it is blended, as
 * it multiplies an alpha that ended. */

#ifndef SQUARE
#define SQUARE 0
#endif

#define MOST_RADIUS 6.0f
#define STEADY_RADIUS 1.64f
#define EXTENT_STEPS 4
/* Steps shorter than this, in standard deviations, are the last. */
#define CLOSE 0.05f

/* 2-norms of each order of the shape, index 0 unused; what all colours' modes are together. */
typedef struct {
  lanes shape[SHAPE_ORDER + 1];
  lanes color_square;
} ModeNorms;

static lanes square_of(__global const float *modes, const int width, int from, int count, Rows rows) {
  lanes sum = 0;
  for (int k = from; k < from + count; k++) {
    const lanes mode = read_one(modes, width, k, rows);
    sum += mode * mode;
  }
  return sum;
}

static ModeNorms norms_of(
    __global const float *restrict shape_modes, __global const float *restrict color_modes, Rows rows)
{
  const int colors = COLOR_MODES * COLOR_CHANNELS;
  ModeNorms norms;
  for (int n = 1; n <= SHAPE_ORDER; n++)
    norms.shape[n] = root_of(square_of(shape_modes, SHAPE_MODES, MODES3(n - 1) - 1, MODES2(n), rows));
  norms.color_square = square_of(color_modes, colors, 0, colors, rows);
  return norms;
}

/* Whether a splat's modes are numbers, whose squares are as well. */
static lanes_int modes_are_finite(const ModeNorms *norms) {
  lanes_int bad = no_number(norms->color_square);
  for (int n = 1; n <= SHAPE_ORDER; n++) bad |= no_number(norms->shape[n]);
  return !bad;
}

/* sqrt(n), 1 / sqrt(n), and He~_2k(0)^2 = C(2k, k) / 4^k. */
__constant float ROOT_OF[] = {
    0, 1, 1.41421356f, 1.73205081f, 2, 2.23606798f, 2.44948974f, 2.64575131f, 2.82842712f};
__constant float INVERSE_ROOT_OF[] = {
    0, 1, 0.70710678f, 0.57735027f, 0.5f, 0.44721360f, 0.40824829f, 0.37796447f, 0.35355339f};
__constant float MIDDLE_SQUARE[] = {1, 0.5f, 0.375f, 0.3125f, 0.2734375f};

/* P(r), with K_n the sum over even k of He~_{n-k}(r)^2 He~_k(0)^2. */
static lanes polynomial_bound(const ModeNorms *norms, lanes r) {
  lanes squares[SHAPE_ORDER + 1], before = 0, here = 1, sum = 1;
  squares[0] = 1;
  UNROLL for (int n = 1; n <= SHAPE_ORDER; n++) {
    const lanes next = (r * here - ROOT_OF[n - 1] * before) * INVERSE_ROOT_OF[n];
    lanes kernel_sum = 0;
    before = here;
    here = next;
    squares[n] = next * next;
    UNROLL for (int k = 0; k <= n; k += 2) kernel_sum += squares[n - k] * MIDDLE_SQUARE[k / 2];
    sum += norms->shape[n] * root_of(kernel_sum);
  }
  return SQUARE ? sum * sum : sum;
}

/* Where splats end, in standard deviations; below zero where they are too faint to be drawn. A lane
 * that is done stays as it is, so that it does not depend on the others. */
static lanes modal_extent(const ModeNorms *norms, lanes weight) {
  if (SMOOTH) return MOST_RADIUS;
  if (XRAY) return HERMITE_EDGE(MOST_ORDER);
  lanes r = MOST_RADIUS;
  lanes_int going = !is_nan(weight), faint = 0, wide = 0;
  for (int step = 0; step < EXTENT_STEPS && any_lane(going); step++) {
    const lanes over = weight / ALPHA_THRESHOLD * polynomial_bound(norms, larger(r, STEADY_RADIUS));
    /* Not a number or too large for one: as wide as any. */
    wide |= going & no_number(over);
    faint |= going & !(over >= 1) & !wide;
    const lanes next = root_of(2 * natural_log(larger(over, 1))), fallen = r - next;
    r = (going & (next < r)) ? next : r;
    if (SHAPE_ORDER == 0) break;
    going &= !wide & !faint & (fallen >= CLOSE);
  }
  r = wide ? MOST_RADIUS : r;
  return faint ? -1 : r;
}
