/* What one projected splat does to a pixel; the same lines for compositing and its gradient.
 *
 *     d = mean - pixel centre,     sigma = (a dx^2 + c dy^2) / 2 + b dx dy,
 *     alpha = min(cap, weight exp(-sigma)).
 *
 * A splat counts from an alpha on, and a pixel is finished by the splat that would leave too little
 * of its transmittance: include/raster/alpha_threshold.h. These thresholds make the image jump as parameters move, so a test can ask for SMOOTH:
 * no thresholds, and exp(-sigma) fades to zero at SMOOTH_EDGE with a continuous slope. Rounding
 * may leave sigma a little below zero next to a needle's mean; it is zero then.
 *
 * screen[splat] = (mean_x, mean_y, a, b, c, weight, extent_x, extent_y): a splat counts nowhere
 * farther from its mean than its extents. */

#include "include/raster/alpha_threshold.h"

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
/* Whether splats have Hermite modes or another activation. */
#ifndef MODAL
#define MODAL 0
#endif

/* Whether the last channel is no sum but the median: the value of the splat that leaves half of the
 * light or less, or of the last one that counts where none does. For depths, in which the mean of what
 * lies before a surface and behind it is the depth of nothing. */
#ifndef MEDIAN
#define MEDIAN 0
#endif
#define SUMS (CHANNELS - MEDIAN)

#define SMOOTH_EDGE 4.5f
/* What sigma is multiplied with to be an exponent of two. */
#define TO_POWER -1.44269504f
#define TO_SIGMA -0.69314718f
/* Line integrals end at 4 standard deviations, wherever tiles lie: 3.4e-4 of a mass lies beyond. */
#define ADDED_EDGE 8.0f

#if SMOOTH
/* -d / d sigma of the smooth stand-in for exp(-sigma), as a multiple of it, of power = TO_POWER sigma; it
 * is 1 for an exponential. */
static lanes falloff_rate(lanes power) {
  const lanes left = SMOOTH_EDGE - TO_SIGMA * power;
  return 1.0f + 2.0f / (left > 1e-3f ? left : 1e-3f);
}
#endif
