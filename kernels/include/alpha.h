/* What one projected splat does to a pixel; the same lines for compositing and its gradient.
 *
 *     d = mean - pixel centre,     sigma = (a dx^2 + c dy^2) / 2 + b dx dy,
 *     alpha = min(cap, weight exp(-sigma)).
 *
 * A splat counts where alpha >= 1/255, and a pixel is finished by the splat that would leave no
 * more than 1e-4 of its transmittance (3D Gaussian Splatting, Kerbl et al. 2023; conventions of
 * gsplat). These thresholds make the image jump as parameters move, so a test can ask for SMOOTH:
 * no thresholds, and exp(-sigma) fades to zero at SMOOTH_EDGE with a continuous slope. Rounding
 * may leave sigma a little below zero next to a needle's mean; it is zero then.
 *
 * screen[splat] = (mean_x, mean_y, a, b, c, weight, extent_x, extent_y): a splat counts nowhere
 * farther from its mean than its extents. */

#include "include/alpha_threshold.h"

#ifndef TILE
#define TILE 16
#endif
#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef SMOOTH
#define SMOOTH 0
#endif
#ifndef ADDITIVE
#define ADDITIVE 0
#endif

#define SMOOTH_EDGE 4.5f
/* What sigma is multiplied with to be an exponent of two. */
#define TO_POWER -1.44269504f
#define TO_SIGMA -0.69314718f
/* Line integrals end at 4 standard deviations, wherever tiles lie: 3.4e-4 of a mass lies beyond. */
#define ADDED_EDGE 8.0f

/* exp(-sigma) or its smooth stand-in, of power = TO_POWER sigma. */
static lanes falloff(lanes power) {
#if SMOOTH
  const lanes rest = 1.0f - power * (TO_SIGMA / SMOOTH_EDGE), left = rest > 0 ? rest : 0;
  return power_of_two(power) * left * left;
#elif ADDITIVE
  return power >= TO_POWER * ADDED_EDGE ? power_of_two(power) : 0;
#else
  return power_of_two(power);
#endif
}

#if SMOOTH
/* -d falloff / d sigma, as a multiple of falloff; it is 1 for an exponential. */
static lanes falloff_rate(lanes power) {
  const lanes left = SMOOTH_EDGE - TO_SIGMA * power;
  return 1.0f + 2.0f / (left > 1e-3f ? left : 1e-3f);
}
#endif

/* The rows of a tile whose centres lie between two edges: the first, and one past the last. */
static int first_row_in(float low) {
  const float v = low - 0.5f;
  const int whole = (int)v;
  return v <= 0 ? 0 : v >= TILE ? TILE : whole < v ? whole + 1 : whole;
}

static int past_row_in(float high) {
  const float v = high - 0.5f;
  return v < 0 ? 0 : v >= TILE ? TILE : (int)v + 1;
}

/* A splat as one tile sees it: places count from the tile's corner, power = a dx^2 + b dx dy +
 * c dy^2 is that of falloff, and rows outside top .. bottom - 1 lie beyond its extents. */
typedef struct {
  float x, y, weight, a, b, c, extent_x;
  int top, bottom;
} TileSplat;

static TileSplat splat_in_tile(__global const float *s, int x0, int y0) {
  TileSplat t;
  t.x = s[0] - x0;
  t.y = s[1] - y0;
  t.a = 0.5f * TO_POWER * s[2];
  t.b = TO_POWER * s[3];
  t.c = 0.5f * TO_POWER * s[4];
  t.weight = s[5];
  t.extent_x = s[6];
  t.top = first_row_in(t.y - s[7]);
  t.bottom = past_row_in(t.y + s[7]);
  return t;
}

/* Whether a strip of LANES pixels, the first of which has its centre at `begin`, is within reach. */
static int reaches_strip(TileSplat t, float begin) {
  return begin <= t.x + t.extent_x && begin + (LANES - 1) >= t.x - t.extent_x;
}
