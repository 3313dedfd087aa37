/* What splat_activate and its gradient have in common: one splat's scales and opacity, before and
 * after the limit of its band. */

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

static float held_exp(float x) { return exp(x < LEAST_LOG ? LEAST_LOG : x > MOST_LOG ? MOST_LOG : x); }

#if AMPLITUDE
/* ln(1 + exp(x)), the optical depth that hides sigmoid(x) of what is behind it. */
static float softplus(float x) { return fmax(x, 0.0f) + log1p(exp(-fabs(x))); }
#endif

/* Scales as trained and as drawn, the opacity as trained (or the density, or the optical depth), and
 * what the limit leaves of it. */
typedef struct {
  float trained[3], drawn[3], opacity, faded;
} Activation;

static Activation activated(
    __global const float *log_scales, __global const float *logits, __global const float *band, long i)
{
  Activation a;
  a.faded = 1;
  for (int k = 0; k < 3; k++) {
    a.trained[k] = a.drawn[k] = held_exp(log_scales[3 * i + k]);
#if BAND
    a.drawn[k] = sqrt(a.trained[k] * a.trained[k] + band[i] * band[i]);
    a.faded *= a.trained[k] / a.drawn[k];
#endif
  }
#if AMPLITUDE
  a.opacity = softplus(logits[i]);
#else
  a.opacity = DENSITY ? held_exp(logits[i]) : 1 / (1 + exp(-logits[i]));
#endif
  return a;
}
