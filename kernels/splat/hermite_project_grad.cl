/* Gradient of hermite_project and, with splat_project_grad, of all that modes hang on.
 *
 * The raster leaves sums over pixels: moments[i] = (H_m for |m| <= SHAPE_ORDER + 2, V_0c for all
 * CHANNELS, V_mc for 1 <= |m| <= COLOR_ORDER and the COLOR_CHANNELS), m graded,
 *
 *     H_m = sum of h He~_m(u'),  V_mc = sum of w v_c He~_m(u'),  v = dL/d image,  w = alpha T,
 *     h = dL/dE weight g, with SQUARE dL/dE weight g Q,
 *
 * for E = weight Q g or weight Q^2 g, Q = sum of s_m He~_m (s_0 = 1), and colours that are a
 * feature plus the sum of t_m He~_m. So
 *
 *     dL/ds_m = H_m (SQUARE: 2 H_m),    dL/dt_mc = V_mc,    weight dL/dweight = sum of s_m H_m.
 *
 * In u' an order is raised by the Gaussian's slope and lowered by the polynomial's,
 *
 *     d(He~_m g)/du_a = -sqrt(m_a + 1) He~_{m+e_a} g,      dHe~_m/du_a = sqrt(m_a) He~_{m-e_a},
 *     d(Q^2 g)/du_a = g Q (dQ/du_a - sum of s_m sqrt(m_a + 1) He~_{m+e_a}),
 *
 * so that P_a, the sum of dL/du'_a, is linear in the moments, and so is R_ab, that of dL/du'_a u'_b,
 * by u_b He~_k = sqrt(k_b + 1) He~_{k+e_b} + sqrt(k_b) He~_{k-e_b}. From u' = L^-1 (pixel - mean),
 * dL/dmean = -L^-T P. The modes hang on A = L^-1 V: with G = dL/dA,
 *
 *     dL/dL = -lower part of L^-T X,  X = R + G A^T,      dL/dV at fixed L = L^-T G (view_parts).
 *
 * Cholesky's factor of Sigma = L L^T passes this on (Murray 2016, arXiv 1602.07527) as dL/dSigma =
 * -L^-T Y L^-1 / 2, Y the symmetric matrix with the lower part of X. That is what second moments
 * S2 = L Y L^T of a Gaussian give, and in their place they go to splat_project_grad, with dL/d(u, v)
 * for first ones: sums[i] = (-weight dL/dweight, dL/du, dL/dv, S2 xx, xy, yy, V_0c).
 *
 * Through one order, c2 = Gamma(A) c, with c2_m sqrt(m!) = T2 contracted N times (hermite_project.h):
 * dT2_m/dA_ai = m_a T2' where T2' has N - 1 indices contracted and i left, and dL/dc runs through the
 * contractions backwards. Splats that are not drawn get zeros.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means[count, 3], quats[count, 4], scales[count, 3], covars[count, 6], shape_modes,
 * grad_shape_modes[count, SHAPE_MODES], color_modes, grad_color_modes[count, COLOR_MODES, COLOR_CHANNELS],
 * culled[count], screen_modes[count, TABLE_LENGTH], moments[count, MOMENTS], sums[count, 6 + CHANNELS],
 * view_parts[count, 6]. */

#include "include/portable.h"
#include "include/projection/camera.h"
#include "include/projection/aperture.h"
#include "include/projection/gaussian.h"
#include "include/projection/hermite_project.h"
#include "include/projection/hermite_project_grad.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef SQUARE
#define SQUARE 0
#endif

#define SHAPE_MOMENTS MODES2(SHAPE_ORDER + 2)
#define MOMENTS (SHAPE_MOMENTS + CHANNELS + SCREEN_COLOR_MODES * COLOR_CHANNELS)
#define PLACE2(order, j) ((order) * ((order) + 1) / 2 + (j))

__constant float ROOTS[] = {
    0, 1, 1.41421356f, 1.73205081f, 2, 2.23606798f, 2.44948974f, 2.64575131f, 2.82842712f, 3, 3.16227766f};

/* The moment of u_b He~_m, m = (order - j, j). */
static lanes moment_times(const lanes *moments, int order, int j, int b) {
  const int m = b ? j : order - j;
  lanes sum = ROOTS[m + 1] * moments[PLACE2(order + 1, j + b)];
  if (m > 0) sum += ROOTS[m] * moments[PLACE2(order - 1, j - b)];
  return sum;
}

/* What comes of a term `factor` He~_m in dL/du_a, m = (order - j, j). */
static void add_slope(ScreenSums *sums, const lanes *moments, int order, int j, int a, lanes factor) {
  sums->first[a] += factor * moments[PLACE2(order, j)];
  const lanes by_x = factor * moment_times(moments, order, j, 0);
  if (a == 0) {
    sums->xx += by_x;
  } else {
    sums->yx += by_x;
    sums->yy += factor * moment_times(moments, order, j, 1);
  }
}

/* A splat's modes on the screen, from its row of the table. */
static lanes screen_mode(__global const float *screen_modes, int place, Rows rows) {
  return read_one(screen_modes, TABLE_LENGTH, WHITENING + place, rows);
}

/* The shape's part of P and R; gives weight dL/dweight. */
static lanes shape_slopes(
    ScreenSums *sums, const lanes *moments, __global const float *screen_modes, Rows rows)
{
  lanes by_weight = 0;
  for (int order = 0; order <= SHAPE_ORDER; order++)
    for (int j = 0; j <= order; j++) {
      const lanes s = order == 0 ? (lanes)1 : screen_mode(screen_modes, PLACE2(order, j) - 1, rows);
      by_weight += s * moments[PLACE2(order, j)];
      for (int a = 0; a < 2; a++) {
        const int m = a ? j : order - j;
        add_slope(sums, moments, order + 1, j + a, a, -s * ROOTS[m + 1]);
        if (SQUARE && m > 0) add_slope(sums, moments, order - 1, j - a, a, s * ROOTS[m]);
      }
    }
  return by_weight;
}

/* A channel's part of P and R. */
static void color_slopes(
    ScreenSums *sums, const lanes *moments, __global const float *screen_modes, int channel, Rows rows)
{
  for (int order = 1; order <= COLOR_ORDER; order++)
    for (int j = 0; j <= order; j++) {
      const int place = SCREEN_SHAPE_MODES + (PLACE2(order, j) - 1) * COLOR_CHANNELS + channel;
      const lanes t = screen_mode(screen_modes, place, rows);
      if (order > j) add_slope(sums, moments, order - 1, j, 0, t * ROOTS[order - j]);
      if (j > 0) add_slope(sums, moments, order - 1, j - 1, 1, t * ROOTS[j]);
    }
}

/* The shape's part of everything; gives weight dL/dweight. */
static lanes shape_grad(
    const Whitening *w, ScreenSums *sums, __global const float *moments, __global const float *modes,
    __global const float *screen_modes, Rows rows, lanes_int drawn, __global float *out)
{
  lanes h[SHAPE_MOMENTS];
  read_columns(moments, MOMENTS, 0, SHAPE_MOMENTS, rows, h);
  for (int order = 1; order <= SHAPE_ORDER; order++) {
    const Columns at = columns_of(SHAPE_MODES, MODES3(order - 1) - 1, 1);
    order_grad(w, sums, modes, at, rows, drawn, order, h + MODES2(order - 1), SQUARE ? 2 : 1, out);
  }
  return shape_slopes(sums, h, screen_modes, rows);
}

/* A channel's part of everything. */
static void color_grad(
    const Whitening *w, ScreenSums *sums, __global const float *moments, int channel,
    __global const float *modes, __global const float *screen_modes, Rows rows, lanes_int drawn,
    __global float *out)
{
  lanes v[MODES2(COLOR_ORDER)];
  v[0] = read_one(moments, MOMENTS, SHAPE_MOMENTS + channel, rows);
  for (int m = 1; m < MODES2(COLOR_ORDER); m++)
    v[m] = read_one(
        moments, MOMENTS, SHAPE_MOMENTS + CHANNELS + (m - 1) * COLOR_CHANNELS + channel, rows);
  for (int order = 1; order <= COLOR_ORDER; order++) {
    const int first = (MODES3(order - 1) - 1) * COLOR_CHANNELS + channel;
    const Columns at = columns_of(COLOR_MODES * COLOR_CHANNELS, first, COLOR_CHANNELS);
    order_grad(w, sums, modes, at, rows, drawn, order, v + MODES2(order - 1), 1, out);
  }
  color_slopes(sums, v, screen_modes, channel, rows);
}

/* From P, R and G to the sums of splat_project_grad and the view's part. */
static void leave_sums(
    const Gaussian *g, const Whitening *w, const ScreenSums *sums, lanes by_weight, Rows rows,
    lanes_int drawn, __global float *out, __global float *view_parts)
{
  const lanes xx = sums->xx + dot_of(sums->a0, w->a0);
  const lanes yx = sums->yx + dot_of(sums->a1, w->a0);
  const lanes yy = sums->yy + dot_of(sums->a1, w->a1);
  /* L from what it is made of: its inverse would be a quotient of quotients. */
  const lanes l00 = 1 / w->i00, l11 = 1 / w->i11, l10 = dot_of(g->v0, g->v1) * w->i00;
  const lanes left = l10 * xx + l11 * yx;
  const lanes3 part0 = plus(times(w->i00, sums->a0), times(w->i10, sums->a1)), part1 = times(w->i11, sums->a1);
  lanes moments[6], view[6];
  moments[0] = -by_weight;
  moments[1] = -(w->i00 * sums->first[0] + w->i10 * sums->first[1]);
  moments[2] = -w->i11 * sums->first[1];
  moments[3] = l00 * l00 * xx;
  moments[4] = l00 * left;
  moments[5] = l10 * left + l11 * (l10 * yx + l11 * yy);
  view[0] = part0.x;
  view[1] = part0.y;
  view[2] = part0.z;
  view[3] = part1.x;
  view[4] = part1.y;
  view[5] = part1.z;
  UNROLL for (int k = 0; k < 6; k++) {
    moments[k] = drawn ? moments[k] : 0;
    view[k] = drawn ? view[k] : 0;
  }
  write_columns(out, 6 + CHANNELS, 0, 6, rows, moments);
  write_columns(view_parts, 6, 0, 6, rows, view);
}

KERNEL void hermite_project_grad(
    __global const float *restrict means, SHAPES, __global const float *restrict shape_modes,
    __global const float *restrict color_modes, __global const uchar *restrict culled,
    __global const float *restrict screen_modes, __global const float *restrict moments,
    CAMERA_PARAMETERS, float near_plane, float far_plane, float eps2d, int count,
    __global float *restrict sums, __global float *restrict view_parts,
    __global float *restrict grad_shape_modes, __global float *restrict grad_color_modes)
{
  const Camera camera = CAMERA;
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = read_bytes(culled, rows) == VISIBLE;
    Gaussian g;
    see_gaussian(&g, camera, means, SHAPE, rows, near_plane, far_plane, eps2d);
    const Whitening w = whiten(&g);
    ScreenSums screen;
    screen.first[0] = screen.first[1] = screen.xx = screen.yx = screen.yy = 0;
    screen.a0 = screen.a1 = lanes3_of(0, 0, 0);
    const lanes by_weight = shape_grad(
        &w, &screen, moments, shape_modes, screen_modes, rows, drawn, grad_shape_modes);
    for (int c = 0; COLOR_ORDER > 0 && c < COLOR_CHANNELS; c++)
      color_grad(&w, &screen, moments, c, color_modes, screen_modes, rows, drawn, grad_color_modes);
    leave_sums(&g, &w, &screen, by_weight, rows, drawn, sums, view_parts);
    for (int c = 0; c < CHANNELS; c++) {
      const lanes by_feature = read_one(moments, MOMENTS, SHAPE_MOMENTS + c, rows);
      write_one(sums, 6 + CHANNELS, 6 + c, rows, drawn ? by_feature : 0);
    }
  }
}
