/* What a splat does to the pixels of a block (pixel_blocks.h), for compositing and its gradient.
 *
 * With (dx, dy) = pixel centre - mean and the numbers of screen_record.h,
 *
 *     power = level - place^2,    level = peak - (far dx)^2,    place = lean dx + rise dy,
 *     g = 2^power = weight exp(-sigma).
 *
 * Level is the same in all rows of a column, and the next vector's place is 2 rise more. With a
 * polynomial Q of the place (hermite_modes.h; 1 for a Gaussian) the splat's density is E = Q g, or
 * Q^2 g, and alpha follows from that as hermite_alpha.h says: a Gaussian is order 0 of the modes,
 * where E can be judged by its exponent before it is there.
 *
 * SMOOTH, for tests, knows no thresholds; a Gaussian, which ends at 3.33 standard deviations, then
 * fades to zero at SMOOTH_EDGE with a continuous slope, and modes reach farther. */

/* Whether the exponent says at once if a splat counts; what is not counted may be any number. */
#define JUDGED_BY_POWER (SHAPE_ORDER == 0 && !SMOOTH && !ADDITIVE)
/* A Gaussian that fades, see above. */
#define FADES (SMOOTH && !MODAL)
/* log2 of LEAST_DENSITY. */
#define LEAST_SEEN (ACTIVATION == CLAMP ? ALPHA_THRESHOLD_LOG2 : DEPTH_THRESHOLD_LOG2)

/* How far u1 wants Hermite polynomials. */
#ifndef HE_ORDER
#define HE_ORDER ORDER
#endif

/* A splat as the columns of a block see it, at the block's first vector. */
typedef struct {
  float peak, down;
  lanes dx, dy, across, level, place;
#if MODAL
  /* He~_i(u1), and the polynomials along a column as coefficients of powers of the place. */
  lanes he[HE_ORDER + 1], shape[SHAPE_ORDER + 1], color[VARIED + 1][COLOR_ORDER + 1];
#endif
} Sight;

static Sight see_splat(const Batch *batch, int k, lanes px, lanes py) {
  Sight s;
  s.dx = px - batch->x[k];
  s.dy = py - batch->y[k];
  s.peak = batch->peak[k];
  s.down = 2 * batch->rise[k];
  s.across = batch->far[k] * s.dx;
  s.level = s.peak - s.across * s.across;
  s.place = batch->lean[k] * s.dx + batch->rise[k] * s.dy;
#if MODAL
  const lanes u1 = s.across * (1 / STRETCH);
  hermite_values(s.he, absolute(u1) < REACH ? u1 : 0, HE_ORDER);
  polynomial_of_column(s.shape, batch->shape[k], s.he, SHAPE_ORDER);
  UNROLL for (int n = 0; n < VARIED; n++)
    polynomial_of_column(s.color[n], batch->color[k][n], s.he, COLOR_ORDER);
#endif
  return s;
}

/* exp(-sigma) times the weight, of power = peak + TO_POWER sigma. */
static lanes falloff_of(lanes power, float peak) {
#if JUDGED_BY_POWER
  return two_to_about(power);
#elif FADES
  const lanes rest = 1.0f - (power - peak) * (TO_SIGMA / SMOOTH_EDGE), left = rest > 0 ? rest : 0;
  return two_to_the(power) * left * left;
#else
  return two_to_the(power);
#endif
}

/* The place where a polynomial is asked for: powers of one far out are too large for a float. */
static lanes place_within(lanes place, lanes power, float peak) {
  return power >= peak + LEAST_POWER ? place : 0;
}

static lanes shape_at(const Sight *s, lanes v) {
#if MODAL && SHAPE_ORDER > 0
  return polynomial_at(s->shape, v, SHAPE_ORDER);
#else
  return 1;
#endif
}

static lanes density_of(lanes g, lanes shaped) {
#if SHAPE_ORDER == 0
  return g;
#else
  return SQUARED ? shaped * shaped * g : shaped * g;
#endif
}

/* Whether the splat counts at a pixel. */
static lanes_int splat_counts(lanes power, lanes density, float peak) {
#if FADES
  return power == power;
#elif ADDITIVE
  return power >= peak + LEAST_POWER;
#elif JUDGED_BY_POWER
  return power >= LEAST_SEEN;
#else
  return density >= LEAST_DENSITY;
#endif
}

/* Channel n of the splat's colour. */
static lanes color_seen(const Batch *batch, const Sight *s, int k, int n, lanes v) {
#if MODAL
  if (n < VARIED) return polynomial_at(s->color[n], v, COLOR_ORDER);
#endif
  return batch->feature[n][k];
}
