/* Hermite- and Laguerre-Gaussian modes of a plane in standard form, and sums of their slopes.
 *
 * Both kinds are ordered by total order n, the modes of one order from MODE_AT(n) on. Polynomials
 * come from recurrences that hold the norms, without the Gaussian and 1/sqrt(pi), which are the
 * factor of all:
 *
 *   Hermite   P_m(x) P_j(y), n = m + j, j rising:    sqrt(n+1) P_n+1 = sqrt(2) x P_n - sqrt(n) P_n-1,
 *             P_n' = sqrt(2n) P_n-1;
 *   Laguerre  Re, Im (x + i y)^l M_p(q), q = x^2 + y^2, n = 2p + l, p rising (sqrt(2) for l > 0):
 *             sqrt((p+1)(p+1+l)) M_p+1 = (q - (2p+1+l)) M_p - sqrt(p(p+l)) M_p-1, M_0 = 1/sqrt(l!),
 *             the same differentiated for M_p'.
 *
 * Slopes of the Gaussian are -x and -y times the sum. MODES is their number, at most 35. */

/* The order of the last of them. */
#define ORDER \
  (MODES > 28 ? 7 : MODES > 21 ? 6 : MODES > 15 ? 5 : MODES > 10 ? 4 : MODES > 6 ? 3 : MODES > 3 ? 2 : MODES > 1)
#define MODE_AT(n) ((n) * ((n) + 1) / 2)
#define INVERSE_ROOT_PI 0.56418958354775629f
#define ROOT_TWO 1.4142135623730951f

__constant float ROOT[9] = {
    0.0f, 1.0f, 1.4142135623730951f, 1.7320508075688772f, 2.0f,
    2.2360679774997898f, 2.4494897427831781f, 2.6457513110645907f, 2.8284271247461903f};

#if LOBES == HG

static void hermite_row(lanes x, lanes *p) {
  p[0] = 1;
  UNROLL
  for (int n = 0; n < ORDER; n++)
    p[n + 1] = (ROOT_TWO * x * p[n] - (n > 0 ? ROOT[n] * p[n - 1] : (lanes)0)) * (1 / ROOT[n + 1]);
}

/* All modes at (x, y), times factor. */
static void plane_modes(lanes x, lanes y, lanes factor, lanes *value) {
  lanes across[ORDER + 1], up[ORDER + 1];
  hermite_row(x, across);
  hermite_row(y, up);
  UNROLL
  for (int n = 0; n <= ORDER; n++)
    UNROLL
    for (int j = 0; j <= n; j++)
      if (MODE_AT(n) + j < MODES) value[MODE_AT(n) + j] = factor * across[n - j] * up[j];
}

/* Sum of modes times weight, and its slopes by x and y: (sum, d/dx, d/dy), times factor. */
static lanes3 plane_slopes(lanes x, lanes y, lanes factor, const lanes *weight) {
  lanes across[ORDER + 1], up[ORDER + 1];
  hermite_row(x, across);
  hermite_row(y, up);
  lanes sum = 0, by_x = 0, by_y = 0;
  UNROLL
  for (int n = 0; n <= ORDER; n++)
    UNROLL
    for (int j = 0; j <= n; j++)
      if (MODE_AT(n) + j < MODES) {
        const lanes w = weight[MODE_AT(n) + j];
        const int m = n - j;
        sum += w * across[m] * up[j];
        if (m > 0) by_x += w * ROOT[m] * across[m - 1] * up[j];
        if (j > 0) by_y += w * ROOT[j] * across[m] * up[j - 1];
      }
  return times(factor, lanes3_of(sum, ROOT_TWO * by_x - x * sum, ROOT_TWO * by_y - y * sum));
}

#elif LOBES == LG

/* 1 / sqrt(l!), times sqrt(2) for l > 0. */
__constant float FIRST[8] = {
    1.0f, 1.4142135623730951f, 1.0f, 0.57735026918962584f,
    0.28867513459481292f, 0.12909944487358055f, 0.052704627669472988f, 0.019920476822239893f};

/* Re and Im of (x + i y)^l. */
static void spirals(lanes x, lanes y, lanes *re, lanes *im) {
  re[0] = 1;
  im[0] = 0;
  UNROLL
  for (int l = 0; l < ORDER; l++) {
    re[l + 1] = x * re[l] - y * im[l];
    im[l + 1] = x * im[l] + y * re[l];
  }
}

/* The next of the radial polynomials after `here` and `below`. */
static lanes next_radial(lanes q, int p, int l, lanes here, lanes below) {
  return ((q - (float)(2 * p + 1 + l)) * here - ROOT[p] * ROOT[p + l] * below) *
      (1 / (ROOT[p + 1] * ROOT[p + 1 + l]));
}

/* All modes at (x, y), times factor. */
static void plane_modes(lanes x, lanes y, lanes factor, lanes *value) {
  const lanes q = x * x + y * y;
  lanes re[ORDER + 1], im[ORDER + 1];
  spirals(x, y, re, im);
  UNROLL
  for (int l = 0; l <= ORDER; l++) {
    lanes here = factor * FIRST[l], below = 0;
    UNROLL
    for (int p = 0; 2 * p + l <= ORDER; p++) {
      const int at = MODE_AT(2 * p + l) + 2 * p;
      if (at < MODES) value[at] = re[l] * here;
      if (l > 0 && at + 1 < MODES) value[at + 1] = im[l] * here;
      const lanes next = next_radial(q, p, l, here, below);
      below = here;
      here = next;
    }
  }
}

/* Sum of modes times weight, and its slopes by x and y: (sum, d/dx, d/dy), times factor. */
static lanes3 plane_slopes(lanes x, lanes y, lanes factor, const lanes *weight) {
  const lanes q = x * x + y * y;
  lanes re[ORDER + 1], im[ORDER + 1], total = 0, steep = 0, by_x = 0, by_y = 0;
  spirals(x, y, re, im);
  UNROLL
  for (int l = 0; l <= ORDER; l++) {
    lanes here = FIRST[l], below = 0, slope = 0, slope_below = 0;
    UNROLL
    for (int p = 0; 2 * p + l <= ORDER; p++) {
      const int at = MODE_AT(2 * p + l) + 2 * p;
      const lanes cosine = at < MODES ? weight[at] : (lanes)0;
      const lanes sine = l > 0 && at + 1 < MODES ? weight[at + 1] : (lanes)0;
      const lanes wave = cosine * re[l] + sine * im[l];
      total += here * wave;
      steep += slope * wave;
      if (l > 0) {
        by_x += (float)l * here * (cosine * re[l - 1] + sine * im[l - 1]);
        by_y += (float)l * here * (sine * re[l - 1] - cosine * im[l - 1]);
      }
      const lanes next = next_radial(q, p, l, here, below);
      const lanes next_slope =
          next_radial(q, p, l, slope, slope_below) + here * (1 / (ROOT[p + 1] * ROOT[p + 1 + l]));
      below = here;
      here = next;
      slope_below = slope;
      slope = next_slope;
    }
  }
  const lanes inward = 2 * steep - total;
  return times(factor, lanes3_of(total, by_x + x * inward, by_y + y * inward));
}

#endif
