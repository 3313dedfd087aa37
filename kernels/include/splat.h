/* What one projected splat does to a pixel; the same lines for compositing and its gradient.
 *
 *     d = mean - pixel centre,     sigma = (a dx^2 + c dy^2) / 2 + b dx dy,
 *     alpha = min(cap, weight exp(-sigma)).
 *
 * A splat counts where sigma >= 0 and alpha >= 1/255, and a pixel is finished by the splat that
 * would leave less than 1e-4 of its transmittance (3D Gaussian Splatting, Kerbl et al. 2023;
 * conventions of gsplat). These thresholds make the image jump as parameters move, so a test can
 * ask for SMOOTH: no thresholds, and exp(-sigma) fades to zero at SMOOTH_EDGE with a continuous
 * slope.
 *
 * screen[splat] = (mean_x, mean_y, a, b, c, weight, depth, extra). */

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

#define FAINTEST (1.0f / 255.0f)
#define OPAQUE 1e-4f
#define SMOOTH_EDGE 4.5f
/* Boxes end at 3.33 standard deviations; so does what is added, wherever tiles lie. */
#define BOX_EDGE 5.54445f

/* exp(-sigma), or its smooth stand-in. */
static lanes falloff(lanes sigma) {
#if SMOOTH
  const lanes left = sigma < SMOOTH_EDGE ? 1.0f - sigma * (1.0f / SMOOTH_EDGE) : 0;
  return exp_minus(sigma) * left * left;
#elif ADDITIVE
  return sigma <= BOX_EDGE ? exp_minus(sigma) : 0;
#else
  return exp_minus(sigma);
#endif
}

/* -d falloff / d sigma, as a multiple of falloff. */
static lanes falloff_rate(lanes sigma) {
#if SMOOTH
  const lanes left = SMOOTH_EDGE - sigma;
  return 1.0f + 2.0f / (left > 1e-3f ? left : 1e-3f);
#else
  return 1.0f + 0.0f * sigma;
#endif
}
