/* What a splat with modes does to a pixel; the same lines for compositing and its gradient.
 *
 * With g = exp(-|u'|^2 / 2) and the polynomial Q of include/raster/hermite_modes.h:
 *
 *     CLAMP:  E = weight Q g,      alpha = min(cap, max(E, 0));
 *     EXP:    E = weight Q g,      alpha = min(cap, 1 - exp(-max(E, 0))), E an optical depth;
 *     SQUARE: E = weight Q^2 g,    alpha = min(cap, 1 - exp(-E)).
 *
 * A splat counts where alpha >= 1/255, which is asked of E, as it is cheaper; SMOOTH, for tests,
 * counts it wherever E > 0 and keeps the cap. An E that is no number counts nowhere. */

#define CLAMP 0
#define EXP 1
#define SQUARE 2
#ifndef ACTIVATION
#define ACTIVATION CLAMP
#endif

/* Line integrals are neither squared nor clamped. */
#define SQUARED (ACTIVATION == SQUARE && !ADDITIVE)

#if SMOOTH
#define LEAST_DENSITY 0
#elif ACTIVATION == CLAMP
#define LEAST_DENSITY ALPHA_THRESHOLD
#else
#define LEAST_DENSITY DEPTH_THRESHOLD
#endif

/* E where the splat counts, zero elsewhere. */
static lanes density_that_counts(lanes density, lanes_int within) {
#if ADDITIVE
  return within ? density : 0;
#else
  return density >= LEAST_DENSITY ? density : 0;
#endif
}

/* alpha before the cap, for E >= 0. 1 - 2^x is taken from (2^f - 1) / f, f in (-1, 0] the part of x
 * behind the point, which is a polynomial of degree 4 with relative error 4e-7 (minimax): a small
 * E keeps its digits, and none at all hides nothing. */
static lanes hidden_by(lanes density) {
#if ACTIVATION == CLAMP
  return density;
#else
  lanes x = TO_POWER * density;
  x = x > -126.0f ? x : -126.0f;
  const lanes_int whole = TO_INT(x);
  const lanes f = x - TO_FLOAT(whole), scale = AS_LANES((whole + 127) << 23);
  const lanes high = (0.0010016494f * f + 0.009340084f) * f + 0.055405777f;
  const lanes rate = (high * f + 0.24021408f) * f + 0.69314694f;
  return (1.0f - scale) - scale * (f * rate);
#endif
}

/* No splat counts where not even the cap does. */
static float cap_that_counts(float cap) { return SMOOTH || cap >= ALPHA_THRESHOLD ? cap : 0; }
