/* Where the pixels of a tilted detector are seen on an upright one, and what they read there.
 *
 * The ray to pixel (i, k) of a view meets the view's upright detector, whose rows run along the
 * volume's slabs, at the row v and the column u that are ratios of linear forms,
 *
 *     u = (h0 + h1 k + h2 i) / (h6 + h7 k + h8 i),   v = (h3 + h4 k + h5 i) / (the same),
 *
 * k, i, u and v counted from the middles of both detectors. A pixel's value is the upright view's,
 * interpolated by Keys' cubic (IEEE Trans. ASSP 29, 1153, 1981) along both axes, or with SPLINE 1 the
 * sum of cubic B-splines, of which the upright view has the factors (spline_coefficients.cl). */

#ifndef SPLINE
#define SPLINE 0
#endif

/* Numbers of a view: the forms, then those of the way back from (v, u) to (i, k). */
#define VIEW_FORMS 18
#define WAY_BACK 9

static lanes keys(lanes d) {
  const lanes a = absolute(d);
  const lanes near = 1.0f + a * a * (1.5f * a - 2.5f);
  const lanes far = 2.0f + a * (-4.0f + a * (2.5f - 0.5f * a));
  const lanes zero = 0;
  return a < 1.0f ? near : (a < 2.0f ? far : zero);
}

static lanes spline(lanes d) {
  const lanes a = absolute(d), rest = 2.0f - a;
  const lanes near = (4.0f + a * a * (3.0f * a - 6.0f)) * (real)(1.0 / 6.0);
  const lanes far = rest * rest * rest * (real)(1.0 / 6.0);
  const lanes zero = 0;
  return a < 1.0f ? near : (a < 2.0f ? far : zero);
}

#if SPLINE
/* Factors beyond an image's ends, whose samples are zero, are the end's times powers of the pole:
 * their shares are the end's own. */
#define POLE_BEYOND ((real)-0.26794919243112270647)
static lanes share(lanes u, lanes at, int samples) {
  const real last = samples - 1;
  u = u > 0 ? u : 0;
  u = u < last ? u : last;
  const lanes left = POLE_BEYOND * (spline(u + 1.0f) + POLE_BEYOND * spline(u + 2.0f));
  const lanes d = u - (last + 1.0f);
  const lanes right = POLE_BEYOND * (spline(d) + POLE_BEYOND * spline(d - 1.0f));
  return spline(u - at) + (at == 0.0f ? left : 0) + (at == last ? right : 0);
}

/* Half a sample beyond the outer ones, and a rounding, is theirs. */
#define BEYOND 0.51f
static lanes_int within(lanes u, int samples) {
  return u >= -BEYOND && u <= (real)(samples - 1) + BEYOND;
}
#else
static lanes share(lanes u, lanes at, int samples) { return keys(u - at); }

/* Four samples stand about u. */
static lanes_int within(lanes u, int samples) { return u >= 1.0f && u < (real)(samples - 2); }
#endif

/* The derivative of keys. */
static lanes keys_slope(lanes d) {
  const lanes a = absolute(d);
  const lanes near = a * (4.5f * a - 5.0f);
  const lanes far = -4.0f + a * (5.0f - 1.5f * a);
  const lanes zero = 0;
  const lanes slope = a < 1.0f ? near : (a < 2.0f ? far : zero);
  return d < 0 ? -slope : slope;
}

/* Column and row at which (k, i) is seen by the forms h, and what they are divided by. */
static void seen_at(
    __global const real *h, lanes k, lanes i, lanes *u, lanes *v, lanes *depth)
{
  *depth = h[6] + h[7] * k + h[8] * i;
  const lanes over = 1.0f / *depth;
  *u = (h[0] + h[1] * k + h[2] * i) * over;
  *v = (h[3] + h[4] * k + h[5] * i) * over;
}
