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
 * Sums of line integrals, which no display rounds, end where include/hermite_edge.h says, and
 * SMOOTH cut-offs at MOST_RADIUS. A colour's polynomial widens nothing where it is blended, as it
 * multiplies an alpha that ended. */

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
  float shape[SHAPE_ORDER + 1];
  float color_square;
} ModeNorms;

static float square_of(__global const float *modes, int count) {
  float sum = 0;
  for (int k = 0; k < count; k++) sum += modes[k] * modes[k];
  return sum;
}

static ModeNorms norms_of(
    __global const float *restrict shape_modes, __global const float *restrict color_modes, long i)
{
  ModeNorms norms;
  __global const float *shape = shape_modes + i * SHAPE_MODES;
  for (int n = 1; n <= SHAPE_ORDER; n++)
    norms.shape[n] = sqrt(square_of(shape + MODES3(n - 1) - 1, MODES2(n)));
  const int colors = COLOR_MODES * COLOR_CHANNELS;
  norms.color_square = square_of(color_modes + i * colors, colors);
  return norms;
}

/* Whether a splat's modes are numbers, whose squares are as well. */
static int modes_are_finite(const ModeNorms *norms) {
  for (int n = 1; n <= SHAPE_ORDER; n++)
    if (not_finite(norms->shape[n])) return 0;
  return !not_finite(norms->color_square);
}

/* sqrt(n), 1 / sqrt(n), and He~_2k(0)^2 = C(2k, k) / 4^k. */
__constant float ROOT_OF[] = {
    0, 1, 1.41421356f, 1.73205081f, 2, 2.23606798f, 2.44948974f, 2.64575131f, 2.82842712f};
__constant float INVERSE_ROOT_OF[] = {
    0, 1, 0.70710678f, 0.57735027f, 0.5f, 0.44721360f, 0.40824829f, 0.37796447f, 0.35355339f};
__constant float MIDDLE_SQUARE[] = {1, 0.5f, 0.375f, 0.3125f, 0.2734375f};

/* P(r), with K_n the sum over even k of He~_{n-k}(r)^2 He~_k(0)^2. */
static float polynomial_bound(const ModeNorms *norms, float r) {
  float squares[SHAPE_ORDER + 1], before = 0, here = 1, sum = 1;
  squares[0] = 1;
  UNROLL for (int n = 1; n <= SHAPE_ORDER; n++) {
    const float next = (r * here - ROOT_OF[n - 1] * before) * INVERSE_ROOT_OF[n];
    float kernel_sum = 0;
    before = here;
    here = next;
    squares[n] = next * next;
    UNROLL for (int k = 0; k <= n; k += 2) kernel_sum += squares[n - k] * MIDDLE_SQUARE[k / 2];
    sum += norms->shape[n] * sqrt(kernel_sum);
  }
  return SQUARE ? sum * sum : sum;
}

/* Where a splat ends, in standard deviations; below zero where it is too faint to be drawn. */
static float modal_extent(const ModeNorms *norms, float weight) {
  if (SMOOTH) return MOST_RADIUS;
  if (XRAY) return HERMITE_EDGE(MOST_ORDER);
  float r = MOST_RADIUS;
  for (int step = 0; step < EXTENT_STEPS; step++) {
    const float steady = larger(r, STEADY_RADIUS);
    const float over = weight / ALPHA_THRESHOLD * polynomial_bound(norms, steady);
    /* Not a number or too large for one: as wide as any. */
    if (not_finite(over)) return MOST_RADIUS;
    if (!(over >= 1)) return -1;
    const float next = sqrt(2 * natural_log(over));
    const float fallen = r - next;
    r = next < r ? next : r;
    if (SHAPE_ORDER == 0 || fallen < CLOSE) break;
  }
  return r;
}
