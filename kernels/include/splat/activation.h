/* What splat_activate and splat_update have in common: splats' scales and opacities, before and after
 * the limit of their band, LANES at a time. */

#include "include/splat/splat_rows.h"

#ifndef DENSITY
#define DENSITY 0
#endif
#ifndef AMPLITUDE
#define AMPLITUDE 0
#endif
#ifndef BAND
#define BAND 0
#endif

/* ln of the smallest and the largest scale, and density. */
#define LEAST_LOG -30.0f
#define MOST_LOG 30.0f

/* NaN stays NaN, so that no splat of it is drawn. */
static lanes held_exp(lanes x) {
  const lanes above = x > LEAST_LOG ? x : LEAST_LOG;
  return is_nan(x) ? x : power_of_e(above < MOST_LOG ? above : MOST_LOG);
}

static lanes sigmoid(lanes x) { return is_nan(x) ? x : 1 / (1 + power_of_e(-x)); }

#if AMPLITUDE
/* ln(1 + exp(x)), the optical depth that hides sigmoid(x) of what is behind it: with y = exp(-|x|),
 * ln(1 + y) = 2 artanh s, s = y / (2 + y), whose series keeps the digits of a small y. */
static lanes softplus(lanes x) {
  const lanes y = is_nan(x) ? x : power_of_e(-absolute(x)), s = y / (2 + y), t = s * s;
  const lanes far = 1 / 9.0f + t * (1 / 11.0f + t * (1 / 13.0f + t * (1 / 15.0f)));
  return (x > 0 ? x : 0) + 2 * s * (1 + t * (1 / 3.0f + t * (1 / 5.0f + t * (1 / 7.0f + t * far))));
}
#endif

/* Scales as trained and as drawn, the opacity as trained (or the density, or the optical depth), and
 * what the limit leaves of it. */
typedef struct {
  lanes3 trained, drawn;
  lanes opacity, faded;
} Activation;

/* A scale as it is drawn with a band. */
static lanes blurred(lanes scale, lanes band) { return root_of(scale * scale + band * band); }

static Activation activated(
    __global const float *log_scales, lanes logit, __global const float *band, Rows rows)
{
  const lanes3 logs = read3(log_scales, 3, rows);
  Activation a;
  a.trained = lanes3_of(held_exp(logs.x), held_exp(logs.y), held_exp(logs.z));
  a.drawn = a.trained;
  a.faded = 1;
#if BAND
  const lanes b = read_numbers(band, rows);
  a.drawn = lanes3_of(blurred(a.trained.x, b), blurred(a.trained.y, b), blurred(a.trained.z, b));
  a.faded = a.trained.x / a.drawn.x * (a.trained.y / a.drawn.y) * (a.trained.z / a.drawn.z);
#endif
#if AMPLITUDE
  a.opacity = softplus(logit);
#else
  a.opacity = DENSITY ? held_exp(logit) : sigmoid(logit);
#endif
  return a;
}
