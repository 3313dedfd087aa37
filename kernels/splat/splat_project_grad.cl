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
 * With DEPTH the last feature is the splat's depth. With CAMERA_GRADIENT each splat leaves its
 * part of dL/d(view, rows of 4), dL/d(fx, fy, cx, cy) in camera_parts, and with DEFOCUS as well of
 * dL/d(radius, focus) in aperture_parts. Nothing flows through extents and culls; splats that are
 * not drawn get zeros. Index space: splats. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/camera.h"
#include "include/aperture.h"
#include "include/gaussian.h"
#include "include/gaussian_grad.h"

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

static void clear(__global float *p, int length) {
  for (int k = 0; k < length; k++) p[k] = 0;
}

#if COVARIANCES

static void clear_shape(__global float *covar, long i) { clear(covar + 6 * i, 6); }

static void shape_grad(
    const Gaussian *g, const float *s, const ViewGradient *view, __global float *covar, long i)
{
  const float2 q0 = apply_conic(g, (float2)(1, 0)), q1 = apply_conic(g, (float2)(0, 1));
  const float2 r0 = apply_conic(g, (float2)(s[3] * q0.x + s[4] * q0.y, s[4] * q0.x + s[5] * q0.y));
  const float2 r1 = apply_conic(g, (float2)(s[3] * q1.x + s[4] * q1.y, s[4] * q1.x + s[5] * q1.y));
  float xx = -0.5f * r0.x, xy = -0.5f * r1.x, yy = -0.5f * r1.y;
#if XRAY || ANTIALIASED || DEFOCUS
  const float half_factor = 0.5f * view->log_factor;
  xx -= half_factor * q0.x;
  xy -= half_factor * q0.y;
  yy -= half_factor * q1.y;
#endif
#if ANTIALIASED || DEFOCUS
  const float share = view->log_factor == 0 ? 0 : half_factor / g->kept;
  xx += share * dot3(g->v1, g->v1);
  xy -= share * dot3(g->v0, g->v1);
  yy += share * dot3(g->v0, g->v0);
#endif
#if DEFOCUS
  xx += share * g->kept_eps;
  yy += share * g->kept_eps;
#endif
  const float3 left = xx * g->m0 + xy * g->m1, right = xy * g->m0 + yy * g->m1;
  float3 rows[3];
  rows[0] = g->m0.x * left + g->m1.x * right;
  rows[1] = g->m0.y * left + g->m1.y * right;
  rows[2] = g->m0.z * left + g->m1.z * right;
#if XRAY
  /* Half the inverse covariance, from the columns of F's inverse. */
  const float3 c0 = cross3(g->root.y, g->root.z) / g->root_det;
  const float3 c1 = cross3(g->root.z, g->root.x) / g->root_det;
  const float3 c2 = cross3(g->root.x, g->root.y) / g->root_det;
  rows[0] += half_factor * (float3)(dot3(c0, c0), dot3(c0, c1), dot3(c0, c2));
  rows[1] += half_factor * (float3)(dot3(c1, c0), dot3(c1, c1), dot3(c1, c2));
  rows[2] += half_factor * (float3)(dot3(c2, c0), dot3(c2, c1), dot3(c2, c2));
#endif
  /* The six numbers stand for nine: off the diagonal each is two entries. */
  store3(covar, 2 * i, (float3)(rows[0].x, 2 * rows[0].y, 2 * rows[0].z));
  store3(covar, 2 * i + 1, (float3)(rows[1].y, 2 * rows[1].z, rows[2].z));
}

#else

static void clear_shape(__global float *quat, __global float *scale, long i) {
  clear(quat + 4 * i, 4);
  clear(scale + 3 * i, 3);
}

static void shape_grad(
    const Gaussian *g, const float *s, const ViewGradient *view,
    __global float *quat, __global float *scale, long i)
{
  /* dL/dF = M^T dL/dV; F = R S. */
  rows3 f;
  f.x = g->m0.x * view->v0 + g->m1.x * view->v1;
  f.y = g->m0.y * view->v0 + g->m1.y * view->v1;
  f.z = g->m0.z * view->v0 + g->m1.z * view->v1;
  float3 by_scale = f.x * g->axes.x + f.y * g->axes.y + f.z * g->axes.z;
#if XRAY
  by_scale += view->log_factor / g->scale;
#endif
  store3(scale, i, by_scale);
  const float3 x = f.x * g->scale, y = f.y * g->scale, z = f.z * g->scale;
  const float4 q = g->quat;
  float4 d;
  d.w = q.x * (z.y - y.z) + q.y * (x.z - z.x) + q.z * (y.x - x.y);
  d.x = q.w * (z.y - y.z) + q.y * (x.y + y.x) + q.z * (x.z + z.x) - 2 * q.x * (y.y + z.z);
  d.y = q.w * (x.z - z.x) + q.x * (x.y + y.x) + q.z * (y.z + z.y) - 2 * q.y * (x.x + z.z);
  d.z = q.w * (y.x - x.y) + q.x * (x.z + z.x) + q.y * (y.z + z.y) - 2 * q.z * (x.x + y.y);
  /* Length has no effect: what is along q goes. */
  const float along = d.x * q.x + d.y * q.y + d.z * q.z + d.w * q.w;
  d = (d - along * q) * (2 / g->quat_length);
  quat[4 * i] = d.w;
  store3(quat + 4 * i + 1, 0, d.xyz);
}

#endif

/* The part of a splat in the gradient of the camera. */
static void camera_grad(
    const Gaussian *g, const ViewGradient *view, const CameraGradient *c, __global float *part)
{
  const float3 q = c->point, du = g->screen.du, dv = g->screen.dv;
  store3(part, 0, q.x * g->world + du.x * view->m0 + dv.x * view->m1);
  store3(part + 4, 0, q.y * g->world + du.y * view->m0 + dv.y * view->m1);
  store3(part + 8, 0, q.z * g->world + du.z * view->m0 + dv.z * view->m1);
  part[3] = q.x;
  part[7] = q.y;
  part[11] = q.z;
  part[12] = c->fx;
  part[13] = c->fy;
  part[14] = c->cx;
  part[15] = c->cy;
}

/* Back from the screen to the mean and the camera. */
static CameraGradient screen_grad(
    const Gaussian *g, Camera camera, const ViewGradient *view, float2 uv, float depth)
{
  ScreenGradient screen;
  screen.u = uv.x;
  screen.v = uv.y;
  screen.log_volume = XRAY ? view->log_factor : 0;
  screen.du = apply3(camera.rotation, view->m0);
  screen.dv = apply3(camera.rotation, view->m1);
  CameraGradient out = to_screen_grad(camera, g->point, screen);
#if DEFOCUS
  add_blur_grad(camera, g->point.z, view->variance, &out);
#endif
  out.point.z += depth;
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
  const long i = get_global_id(0);
  if (i >= count) return;
  const int drawn = culled[i] == VISIBLE;
  float s[RECORD];
  for (int k = 0; k < RECORD; k++) s[k] = drawn ? sums[i * RECORD + k] : 0;
  for (int k = 0; k < CHANNELS; k++) grad_features[i * CHANNELS + k] = s[6 + k];
  for (int k = 0; k < 2 * ABSGRAD; k++) grad_means2d_abs[2 * i + k] = s[6 + CHANNELS + k];
  if (!drawn) {
    clear(grad_means + 3 * i, 3);
    clear(grad_opacities + i, 1);
    clear(grad_means2d + 2 * i, 2);
    clear_shape(SHAPE_GRADIENT, i);
    if (CAMERA_GRADIENT) clear(camera_parts + 16 * i, 16);
#if DEFOCUS && CAMERA_GRADIENT
    clear(aperture_parts + 2 * i, 2);
#endif
    return;
  }
  const Camera camera = CAMERA;
  Gaussian g;
  see_gaussian(&g, camera, means, SHAPE, i, near_plane, far_plane, eps2d);
#if VIEW_PARTS
  ViewGradient view = dilate_grad(&g, s);
  view.v0 += load3(view_parts, 2 * i);
  view.v1 += load3(view_parts, 2 * i + 1);
  view.m0 = apply3(g.root, view.v0);
  view.m1 = apply3(g.root, view.v1);
#else
  const ViewGradient view = dilate_grad(&g, s);
#endif
  const float2 first = (float2)(s[1], s[2]), uv = FIRST_MOMENTS ? apply_conic(&g, first) : first;
  const CameraGradient point = screen_grad(&g, camera, &view, uv, DEPTH ? s[6 + CHANNELS - 1] : 0);
  grad_opacities[i] = -s[0] / opacities[i];
  grad_means2d[2 * i] = uv.x;
  grad_means2d[2 * i + 1] = uv.y;
  shape_grad(&g, s, &view, SHAPE_GRADIENT, i);
  store3(grad_means, i, apply_transposed3(camera.rotation, point.point));
  if (CAMERA_GRADIENT) camera_grad(&g, &view, &point, camera_parts + 16 * i);
#if DEFOCUS && CAMERA_GRADIENT
  aperture_parts[2 * i] = point.radius;
  aperture_parts[2 * i + 1] = point.focus;
#endif
}
