/* Gradient of splat_project.
 *
 * What comes in for a splat is sums[i] = (S0, Sx, Sy, Sxx, Sxy, Syy, features, [|u|, |v|]): sums
 * over pixels of dL/dsigma times (1, dx, dy, dx^2, dx dy, dy^2), of dL/dfeature, and with ABSGRAD
 * the magnitudes of the screen-position gradient. With Q the inverse of the dilated screen
 * covariance, S2 the matrix of second moments, U = Q V and S0 = -dL/dln(weight),
 *
 *     dL/d(u, v) = Q (Sx, Sy),      dL/dV = -Q S2 U + what the factor adds,
 *
 * (without FIRST_MOMENTS dL/d(u, v) itself comes in place of Sx, Sy)
 * and back through V = J W F to everything that J, W and F are made of. With COVARIANCES dL/dH is
 * needed for H = V V^T: -Q S2 Q / 2 + what the factor adds, and then M^T dL/dH M.
 *
 * With VIEW_PARTS what flows into V besides comes as view_parts[i], dL/dV's rows: the modes of
 * hermite_project_grad.cl hang on V at a fixed screen covariance as well.
 *
 * With DEPTH the last feature is the splat's depth. With CAMERA_GRADIENT each run leaves its part of
 * dL/d(view, rows of 4), dL/d(fx, fy, cx, cy) in its row of camera_parts, and with DEFOCUS as well of
 * dL/d(radius, focus) in aperture_parts: these are summed over the run's splats in their order, lane by
 * lane, and then over the lanes. Nothing flows through extents and culls; splats that are not drawn
 * get zeros. Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means, grad_means[count, 3], quats, grad_quats[count, 4], scales, grad_scales[count, 3], covars,
 * grad_covars[count, 6], opacities, grad_opacities[count], culled[count], sums[count, RECORD],
 * grad_features[count, CHANNELS], grad_means2d[count, 2], grad_means2d_abs[ABSGRAD ? count : 0, 2],
 * camera_parts[CAMERA_GRADIENT ? 16 : 0, (count + RUN - 1) / RUN],
 * aperture_parts[CAMERA_GRADIENT ? 2 : 0, (count + RUN - 1) / RUN], view_parts[count, 6]. */

#include "include/portable.h"
#include "include/projection/camera.h"
#include "include/projection/aperture.h"
#include "include/projection/gaussian.h"
#include "include/projection/gaussian_grad.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef ABSGRAD
#define ABSGRAD 0
#endif
#ifndef DEPTH
#define DEPTH 0
#endif
#ifndef CAMERA_GRADIENT
#define CAMERA_GRADIENT 1
#endif
#ifndef FIRST_MOMENTS
#define FIRST_MOMENTS 1
#endif
#ifndef VIEW_PARTS
#define VIEW_PARTS 0
#endif
#define RECORD (6 + CHANNELS + 2 * ABSGRAD)

#if COVARIANCES
#define SHAPE_GRADIENTS __global float *restrict grad_covars
#define SHAPE_GRADIENT grad_covars
#else
#define SHAPE_GRADIENTS __global float *restrict grad_quats, __global float *restrict grad_scales
#define SHAPE_GRADIENT grad_quats, grad_scales
#endif

#if DEFOCUS
#define APERTURE_GRADIENTS , __global float *restrict aperture_parts
#else
#define APERTURE_GRADIENTS
#endif

#if VIEW_PARTS
#define VIEW_PARAMETER , __global const float *restrict view_parts
#else
#define VIEW_PARAMETER
#endif

#define CAMERA_NUMBERS (16 + 2 * DEFOCUS)

/* Numbers of a splat, where it is drawn. */
static void write_if(
    __global float *table, const int stride, const int from, const int width, Rows rows, lanes_int drawn,
    lanes *column)
{
  UNROLL for (int k = 0; k < width; k++) column[k] = drawn ? column[k] : 0;
  write_columns(table, stride, from, width, rows, column);
}

static void set3(lanes *column, lanes3 v) {
  column[0] = v.x;
  column[1] = v.y;
  column[2] = v.z;
}

#if COVARIANCES

static void shape_grad(
    const Gaussian *g, const lanes *s, const ViewGradient *view, Rows rows, lanes_int drawn,
    __global float *covar)
{
  const lanes q00 = conic_x(g, 1, 0), q01 = conic_y(g, 1, 0), q11 = conic_y(g, 0, 1);
  const lanes t00 = s[3] * q00 + s[4] * q01, t01 = s[4] * q00 + s[5] * q01;
  const lanes t10 = s[3] * q01 + s[4] * q11, t11 = s[4] * q01 + s[5] * q11;
  lanes xx = -0.5f * conic_x(g, t00, t01), xy = -0.5f * conic_x(g, t10, t11);
  lanes yy = -0.5f * conic_y(g, t10, t11);
#if XRAY || ANTIALIASED || DEFOCUS
  const lanes half_factor = 0.5f * view->log_factor;
  xx -= half_factor * q00;
  xy -= half_factor * q01;
  yy -= half_factor * q11;
#endif
#if ANTIALIASED || DEFOCUS
  const lanes share = view->log_factor == 0 ? 0 : half_factor / g->kept;
  xx += share * dot_of(g->v1, g->v1);
  xy -= share * dot_of(g->v0, g->v1);
  yy += share * dot_of(g->v0, g->v0);
#endif
#if DEFOCUS
  xx += share * g->kept_eps;
  yy += share * g->kept_eps;
#endif
  const lanes3 left = plus(times(xx, g->m0), times(xy, g->m1));
  const lanes3 right = plus(times(xy, g->m0), times(yy, g->m1));
  lanes3 row0 = plus(times(g->m0.x, left), times(g->m1.x, right));
  lanes3 row1 = plus(times(g->m0.y, left), times(g->m1.y, right));
  lanes3 row2 = plus(times(g->m0.z, left), times(g->m1.z, right));
#if XRAY
  /* Half the inverse covariance, from the columns of F's inverse. */
  const lanes per = 1 / g->root_det;
  const lanes3 c0 = times(per, cross_of(g->root.y, g->root.z));
  const lanes3 c1 = times(per, cross_of(g->root.z, g->root.x));
  const lanes3 c2 = times(per, cross_of(g->root.x, g->root.y));
  row0 = plus(row0, times(half_factor, lanes3_of(dot_of(c0, c0), dot_of(c0, c1), dot_of(c0, c2))));
  row1 = plus(row1, times(half_factor, lanes3_of(dot_of(c1, c0), dot_of(c1, c1), dot_of(c1, c2))));
  row2 = plus(row2, times(half_factor, lanes3_of(dot_of(c2, c0), dot_of(c2, c1), dot_of(c2, c2))));
#endif
  /* The six numbers stand for nine: off the diagonal each is two entries. */
  lanes out[6];
  set3(out, lanes3_of(row0.x, 2 * row0.y, 2 * row0.z));
  set3(out + 3, lanes3_of(row1.y, 2 * row1.z, row2.z));
  write_if(covar, 6, 0, 6, rows, drawn, out);
}

#else

static void shape_grad(
    const Gaussian *g, const lanes *s, const ViewGradient *view, Rows rows, lanes_int drawn,
    __global float *quat, __global float *scale)
{
  /* dL/dF = M^T dL/dV; F = R S. */
  const lanes3 fx = plus(times(g->m0.x, view->v0), times(g->m1.x, view->v1));
  const lanes3 fy = plus(times(g->m0.y, view->v0), times(g->m1.y, view->v1));
  const lanes3 fz = plus(times(g->m0.z, view->v0), times(g->m1.z, view->v1));
  lanes3 by_scale = plus(plus(product(fx, g->axes.x), product(fy, g->axes.y)), product(fz, g->axes.z));
#if XRAY
  by_scale.x += view->log_factor / g->scale.x;
  by_scale.y += view->log_factor / g->scale.y;
  by_scale.z += view->log_factor / g->scale.z;
#endif
  lanes out[4];
  set3(out, by_scale);
  write_if(scale, 3, 0, 3, rows, drawn, out);
  const lanes3 x = product(fx, g->scale), y = product(fy, g->scale), z = product(fz, g->scale);
  const lanes3 q = g->turn, across = lanes3_of(z.y - y.z, x.z - z.x, y.x - x.y);
  const lanes xy = x.y + y.x, xz = x.z + z.x, yz = y.z + z.y, w = g->real_part;
  const lanes dw = dot_of(q, across);
  const lanes dx = w * across.x + q.y * xy + q.z * xz - 2 * q.x * (y.y + z.z);
  const lanes dy = w * across.y + q.x * xy + q.z * yz - 2 * q.y * (x.x + z.z);
  const lanes dz = w * across.z + q.x * xz + q.y * yz - 2 * q.z * (x.x + y.y);
  /* Length has no effect: what is along q goes. */
  const lanes along = dx * q.x + dy * q.y + dz * q.z + dw * w, twice = 2 / g->quat_length;
  out[0] = (dw - along * w) * twice;
  out[1] = (dx - along * q.x) * twice;
  out[2] = (dy - along * q.y) * twice;
  out[3] = (dz - along * q.z) * twice;
  write_if(quat, 4, 0, 4, rows, drawn, out);
}

#endif

/* A row of dL/d view, from that by a row of the camera's axes: (q world + du M.., q). */
static void view_row_grad(const Gaussian *g, const ViewGradient *view, lanes q, lanes du, lanes dv, lanes *row) {
  set3(row, plus(times(q, g->world), plus(times(du, view->m0), times(dv, view->m1))));
  row[3] = q;
}

/* Adds the parts of LANES splats in the gradient of the camera. */
static void add_camera_grad(
    const Gaussian *g, const ViewGradient *view, const CameraGradient *c, lanes_int drawn, lanes *total)
{
  lanes part[CAMERA_NUMBERS];
  const lanes3 q = c->point, du = g->screen.du, dv = g->screen.dv;
  view_row_grad(g, view, q.x, du.x, dv.x, part);
  view_row_grad(g, view, q.y, du.y, dv.y, part + 4);
  view_row_grad(g, view, q.z, du.z, dv.z, part + 8);
  part[12] = c->fx;
  part[13] = c->fy;
  part[14] = c->cx;
  part[15] = c->cy;
#if DEFOCUS
  part[16] = c->radius;
  part[17] = c->focus;
#endif
  UNROLL for (int k = 0; k < CAMERA_NUMBERS; k++) total[k] += drawn ? part[k] : 0;
}

/* Back from the screen to the mean and the camera. */
static CameraGradient screen_grad(
    const Gaussian *g, Camera camera, const ViewGradient *view, lanes u, lanes v, lanes depth)
{
  ScreenGradient screen;
  screen.u = u;
  screen.v = v;
  screen.log_volume = XRAY ? view->log_factor : 0;
  screen.du = turned(camera, view->m0);
  screen.dv = turned(camera, view->m1);
  CameraGradient out = to_screen_grad(camera, g->point, screen);
#if DEFOCUS
  add_blur_grad(camera, g->point.z, view->variance, &out);
#endif
  add_depth_grad(g->point, depth, &out);
  return out;
}

KERNEL void splat_project_grad(
    __global const float *restrict means, SHAPES, __global const float *restrict opacities,
    __global const uchar *restrict culled, __global const float *restrict sums, CAMERA_PARAMETERS,
    float near_plane, float far_plane, float eps2d, int count,
    __global float *restrict grad_means, SHAPE_GRADIENTS, __global float *restrict grad_opacities,
    __global float *restrict grad_features, __global float *restrict grad_means2d,
    __global float *restrict grad_means2d_abs, __global float *restrict camera_parts APERTURE_GRADIENTS
    VIEW_PARAMETER)
{
  const Camera camera = CAMERA;
  lanes total[CAMERA_NUMBERS];
  UNROLL for (int k = 0; k < CAMERA_NUMBERS; k++) total[k] = 0;
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = (read_bytes(culled, rows) == VISIBLE) & are_there(rows);
    lanes s[RECORD], out[3];
    read_columns(sums, RECORD, 0, RECORD, rows, s);
    UNROLL for (int k = 0; k < RECORD; k++) s[k] = drawn ? s[k] : 0;
    write_columns(grad_features, CHANNELS, 0, CHANNELS, rows, s + 6);
    if (ABSGRAD) write_columns(grad_means2d_abs, 2, 0, 2, rows, s + 6 + CHANNELS);
    Gaussian g;
    see_gaussian(&g, camera, means, SHAPE, rows, near_plane, far_plane, eps2d);
    ViewGradient view = dilate_grad(&g, s);
#if VIEW_PARTS
    lanes v[6];
    read_columns(view_parts, 6, 0, 6, rows, v);
    view.v0 = plus(view.v0, lanes3_of(v[0], v[1], v[2]));
    view.v1 = plus(view.v1, lanes3_of(v[3], v[4], v[5]));
    through_root(&g, &view);
#endif
    const lanes by_u = FIRST_MOMENTS ? conic_x(&g, s[1], s[2]) : s[1];
    const lanes by_v = FIRST_MOMENTS ? conic_y(&g, s[1], s[2]) : s[2];
    const lanes by_depth = DEPTH ? s[6 + CHANNELS - 1] : 0;
    const CameraGradient point = screen_grad(&g, camera, &view, by_u, by_v, by_depth);
    out[0] = by_u;
    out[1] = by_v;
    write_if(grad_means2d, 2, 0, 2, rows, drawn, out);
    out[0] = -s[0] / read_numbers(opacities, rows);
    write_if(grad_opacities, 1, 0, 1, rows, drawn, out);
    set3(out, turned_back(camera, point.point));
    write_if(grad_means, 3, 0, 3, rows, drawn, out);
    shape_grad(&g, s, &view, rows, drawn, SHAPE_GRADIENT);
    if (CAMERA_GRADIENT) add_camera_grad(&g, &view, &point, drawn, total);
  }
#if CAMERA_GRADIENT
  const long run = get_global_id(0);
  if (!HAS_RUN(count)) return;
  for (int k = 0; k < 16; k++) camera_parts[16 * run + k] = SUM_OF_LANES(total[k]);
#if DEFOCUS
  for (int k = 0; k < 2; k++) aperture_parts[2 * run + k] = SUM_OF_LANES(total[16 + k]);
#endif
#endif
}
