/* Hermite polynomials of a splat on the screen, in the place u' = L^-1 (pixel - mean) that makes
 * it round: u1 = i00 dx, u2 = i10 dx + i11 dy, with dx, dy = pixel centre - mean.
 *
 *     Q(u') = 1 + sum of s_ij He~_i(u1) He~_j(u2),  1 <= i + j <= SHAPE_ORDER,
 *     color_c(u') = feature_c + sum of t_ijc He~_i(u1) He~_j(u2),  1 <= i + j <= COLOR_ORDER,
 *                   for channels c < COLORED,
 *     He~_n = He_n / sqrt(n!):   He~_0 = 1,   sqrt(n + 1) He~_{n+1} = x He~_n - sqrt(n) He~_{n-1}.
 *
 * A row of `modes` has ROW numbers: i00, i10, i11, then s_ij, then t_ijc, each mode with its
 * COLORED channels. Modes stand in graded order, MODE(i, j), and the constant one is left out.
 *
 * Along a column of pixels u1 stays what it is, so there a polynomial is one in u2 alone, whose
 * coefficients are worked out once. They are those of powers, which cost one multiply-add each:
 * the Gaussian that multiplies them takes away what cancels (at order 8 and |u'| = 3 the terms are
 * 240 in all, times exp(-9/2)). The powers are of v = STRETCH u2, since then
 * log2 exp(-|u'|^2 / 2) = -(STRETCH u1)^2 - v^2. */

#include "include/raster/screen_record.h"

#ifndef SHAPE_ORDER
#define SHAPE_ORDER 0
#endif
#ifndef COLOR_ORDER
#define COLOR_ORDER 0
#endif
#ifndef COLORED
#define COLORED 0
#endif

#define MODES(order) (((order) + 1) * ((order) + 2) / 2)
#define MODE(i, j) (((i) + (j)) * ((i) + (j) + 1) / 2 + (j))
/* Channels that a polynomial changes, and the larger order. */
#define VARIED (COLOR_ORDER > 0 ? COLORED : 0)
#define ORDER (SHAPE_ORDER > COLOR_ORDER ? SHAPE_ORDER : COLOR_ORDER)
#define COLOR_MODES (2 + MODES(SHAPE_ORDER))
#define ROW (COLOR_MODES + (MODES(COLOR_ORDER) - 1) * COLORED)

/* Nothing of a splat of any order is seen beyond 12 standard deviations; the powers of a place
 * beyond may be too large for a float. Line integrals end where their order says. */
#if ADDITIVE && !SMOOTH
#define REACH HERMITE_EDGE(ORDER)
#else
#define REACH 12.0f
#endif
#define LEAST_POWER (-STRETCH * STRETCH * REACH * REACH)

__constant float ROOTS[11] = {
    0, 1, 1.4142135f, 1.7320508f, 2, 2.236068f, 2.4494898f, 2.6457512f, 2.828427f, 3, 3.1622777f};
__constant float INVERSE_ROOTS[11] = {
    0, 1, 0.70710677f, 0.57735026f, 0.5f, 0.44721361f, 0.40824831f, 0.37796447f, 0.35355338f,
    0.33333334f, 0.31622776f};

/* He~_n(x) = sum over k of IN_POWERS[n][k] (STRETCH x)^k. */
__constant float IN_POWERS[11][11] = {
    {1},
    {0, 1.17741f},
    {-0.70710677f, 0, 0.98025817f},
    {0, -1.4420269f, 0, 0.66635793f},
    {0.61237246f, 0, -1.6978569f, 0, 0.39228824f},
    {0, 1.6122351f, 0, -1.4900216f, 0, 0.20656085f},
    {-0.559017f, 0, 2.3248863f, 0, -1.0743256f, 0, 0.09928877f},
    {0, -1.7414129f, 0, 2.414111f, 0, -0.66933364f, 0, 0.044185404f},
    {0.5229125f, 0, -2.8996427f, 0, 2.009879f, 0, -0.37150455f, 0, 0.01839338f},
    {0, 1.8470473f, 0, -3.4140685f, 0, 1.4198711f, 0, -0.18746279f, 0, 0.0072188503f},
    {-0.49607837f, 0, 3.4385533f, 0, -3.177898f, 0, 0.8811004f, 0, -0.08724747f, 0, 0.0026877928f}};

/* He~_0 .. He~_order at x. */
static void hermite_values(lanes *he, lanes x, int order) {
  he[0] = 1;
  if (order > 0) he[1] = x;
  UNROLL for (int n = 1; n < order; n++)
    he[n + 1] = (x * he[n] - ROOTS[n] * he[n - 1]) * INVERSE_ROOTS[n + 1];
}

/* The loops below go up to ORDER, whatever `order` is, and ask inside which turns count: a compiler
 * unrolls them before it knows who calls. */

/* Coefficients of He~_i(u1) v^k, at MODE(i, k), from those of He~_i(u1) He~_j(u2): the constant
 * one, and the others, which are `stride` apart. */
static void turn_into_powers(
    float *powers, float zeroth, __global const float *others, int stride, int order)
{
  UNROLL for (int i = 0; i <= ORDER; i++)
    UNROLL for (int k = 0; k <= ORDER; k++) {
      if (i + k > order) continue;
      float sum = 0;
      UNROLL for (int up = 0; up <= ORDER; up += 2) {
        const int j = k + up;
        if (i + j <= order)
          sum += IN_POWERS[j][k] * (i + j == 0 ? zeroth : others[(MODE(i, j) - 1) * stride]);
      }
      powers[MODE(i, k)] = sum;
    }
}

/* A polynomial along a column: its coefficients of v^k, given He~_i(u1). */
static void polynomial_of_column(lanes *column, const float *powers, const lanes *he, int order) {
  UNROLL for (int k = 0; k <= ORDER; k++) {
    if (k > order) continue;
    lanes sum = powers[MODE(0, k)];
    UNROLL for (int i = 1; i <= ORDER; i++)
      if (i + k <= order) sum = sum + powers[MODE(i, k)] * he[i];
    column[k] = sum;
  }
}

static lanes polynomial_at(const lanes *column, lanes v, int order) {
  lanes value = column[order];
  UNROLL for (int k = ORDER; k >= 0; k--)
    if (k < order) value = value * v + column[k];
  return value;
}

/* The polynomial from its modes, given He~_i(u1) and He~_j(u2). */
static lanes polynomial_of_modes(
    float zeroth, __global const float *others, int stride, const lanes *he1, const lanes *he2,
    int order)
{
  lanes value = zeroth;
  UNROLL for (int j = 0; j <= ORDER; j++) {
    if (j > order) continue;
    lanes sum = 0;
    UNROLL for (int i = 0; i <= ORDER; i++)
      if (i + j > 0 && i + j <= order) sum = sum + others[(MODE(i, j) - 1) * stride] * he1[i];
    value = value + sum * he2[j];
  }
  return value;
}

/* Channel n of a colour, given He~_i(u1) and He~_j(u2). */
static lanes color_at(
    float feature, __global const float *mode, int n, const lanes *he1, const lanes *he2)
{
  if (n >= VARIED) return feature;
  return polynomial_of_modes(feature, mode + COLOR_MODES + n, COLORED, he1, he2, COLOR_ORDER);
}
