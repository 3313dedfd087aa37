/* A Gaussian in space and what the camera sees of it.
 *
 * The covariance is kept as F F^T: F = R S from a quaternion and scales, or Cholesky's factor of
 * a given covariance. With M = J W, the derivative of the pixel position by the world, the screen
 * covariance is V V^T + eps I, V = M F (2x3). Everything below is written in V's rows v0, v1 and
 * not in the covariance: for a needle seen at an angle a c - b b cancels, while
 *
 *     det(V V^T) = |v0 x v1|^2     and     adj(V V^T) w = (v1 . k, -v0 . k),  k = w.x v1 - w.y v0,
 *
 * keep about as many digits as the numbers that go in. With DEFOCUS eps is eps2d plus the blur of
 * the aperture at the splat's depth.
 *
 * Everything is computed in all lanes: a splat that has no meaning is told by its code, and its
 * numbers, which may be none, are left aside by who uses them. */

#include "include/splat/splat_rows.h"

#ifndef COVARIANCES
#define COVARIANCES 0
#endif
#ifndef XRAY
#define XRAY 0
#endif
#ifndef ANTIALIASED
#define ANTIALIASED 0
#endif

/* Dilation dims an antialiased splat to no less than this. */
#define LEAST_COMPENSATION 0.005f
#define SQRT_TWO_PI 2.5066282746f
/* What rounding may take off a covariance's pivots, as a share of its trace. */
#define ROUNDING 4e-7f
/* Quaternions with no component above this have no direction. */
#define LEAST_QUATERNION 1e-30f

/* Squared areas on the screen that still have a normal inverse. */
#define MOST_AREA 1e37f

/* Why a splat is not drawn. */
#define VISIBLE 0
#define OUT_OF_DEPTH 1
#define DEGENERATE 2
#define TOO_FAINT 3
#define OFF_SCREEN 4
#define CLIPPED 5

#if COVARIANCES
#define SHAPES __global const float *restrict covars
#define SHAPE covars
#else
#define SHAPES __global const float *restrict quats, __global const float *restrict scales
#define SHAPE quats, scales
#endif

typedef struct {
  lanes3 world, point;      /* mean in the world's frame and in the camera's */
  lane_rows root;           /* F */
  lane_rows axes;           /* R, with quaternions alone */
  lanes3 turn;              /* the quaternion, normalised: its imaginary parts, */
  lanes real_part;          /* and its real one */
  lanes quat_length;
  lanes3 scale;
  lanes root_det;           /* |det F| */
  Screen screen;
  lanes3 m0, m1, v0, v1, normal;
  lanes undilated, dilated; /* determinants of V V^T and of V V^T + eps I */
  lanes eps, inverse;       /* inverse of the dilated one */
  lanes kept, kept_eps;     /* determinant of V V^T + kept_eps I, which the factor is measured by */
  lanes factor;             /* weight = opacity * factor */
} Gaussian;

/* The first reason that holds is why a splat is not drawn. */
static lanes_int or_else(lanes_int code, lanes_int holds, int reason) {
  return ((code == VISIBLE) & holds) ? (lanes_int)reason : code;
}

/* matrix * v, and transposed matrix * v. */
static lanes3 applied(lane_rows matrix, lanes3 v) {
  return lanes3_of(dot_of(matrix.x, v), dot_of(matrix.y, v), dot_of(matrix.z, v));
}

static lanes3 applied_transposed(lane_rows matrix, lanes3 v) {
  return plus(plus(times(v.x, matrix.x), times(v.y, matrix.y)), times(v.z, matrix.z));
}

static lane_rows rotation_of(lanes3 q, lanes w) {
  const lanes3 twice = plus(q, q);
  const lanes xx = twice.x * q.x, yy = twice.y * q.y, zz = twice.z * q.z;
  const lanes xy = twice.x * q.y, xz = twice.x * q.z, yz = twice.y * q.z;
  const lanes3 t = times(w, twice);
  lane_rows r;
  r.x = lanes3_of(1 - (yy + zz), xy - t.z, xz + t.y);
  r.y = lanes3_of(xy + t.z, 1 - (xx + zz), yz - t.x);
  r.z = lanes3_of(xz - t.y, yz + t.x, 1 - (xx + yy));
  return r;
}

#if COVARIANCES

/* One column of Cholesky's factor below its pivot; zero where the pivot is nothing but rounding. */
static lanes_int pivot_is_valid(lanes pivot, lanes below, lanes trace, lanes *diagonal) {
  *diagonal = pivot > ROUNDING * trace ? root_of(pivot) : 0;
  return (*diagonal > 0) | ((pivot > -ROUNDING * trace) & (below < 1e-3f * trace));
}

/* A column's number over its pivot. */
static lanes below_pivot(lanes number, lanes diagonal) { return diagonal > 0 ? number / diagonal : 0; }

static lanes_int read_shape(Gaussian *g, SHAPES, Rows rows) {
  lanes h[6], l0, l1, l2;
  read_columns(covars, 6, 0, 6, rows, h);
  const lanes trace = h[0] + h[3] + h[5];
  lanes_int meant = !(no_number(h[0]) | no_number(h[1]) | no_number(h[2]) | no_number(h[3])
      | no_number(h[4]) | no_number(h[5]) | no_number(trace)) & (trace > 0);
  meant &= pivot_is_valid(h[0], larger(absolute(h[1]), absolute(h[2])), trace, &l0);
  const lanes l10 = below_pivot(h[1], l0), l20 = below_pivot(h[2], l0), rest = h[4] - l20 * l10;
  meant &= pivot_is_valid(h[3] - l10 * l10, absolute(rest), trace, &l1);
  const lanes l21 = below_pivot(rest, l1);
  meant &= pivot_is_valid(h[5] - l20 * l20 - l21 * l21, 0, trace, &l2);
  g->root.x = lanes3_of(l0, 0, 0);
  g->root.y = lanes3_of(l10, l1, 0);
  g->root.z = lanes3_of(l20, l21, l2);
  g->root_det = l0 * l1 * l2;
  return meant ? (lanes_int)VISIBLE : (lanes_int)DEGENERATE;
}

#else

static lanes3 product(lanes3 a, lanes3 b) { return lanes3_of(a.x * b.x, a.y * b.y, a.z * b.z); }

static lanes_int read_shape(Gaussian *g, SHAPES, Rows rows) {
  lanes q[4];
  read_columns(quats, 4, 0, 4, rows, q);
  const lanes3 s = read3(scales, 3, rows);
  const lanes largest = larger(larger(absolute(q[0]), absolute(q[1])), larger(absolute(q[2]), absolute(q[3])));
  const lanes_int meant = !(no_number(q[0]) | no_number(q[1]) | no_number(q[2]) | no_number(q[3])
      | no_numbers(s)) & (largest > LEAST_QUATERNION) & (s.x > 0) & (s.y > 0) & (s.z > 0);
  const lanes even = 1 / largest, w = q[0] * even;
  const lanes3 v = lanes3_of(q[1] * even, q[2] * even, q[3] * even);
  const lanes square = dot_of(v, v) + w * w, inverse = inverse_root(square);
  g->turn = times(inverse, v);
  g->real_part = w * inverse;
  g->quat_length = square * inverse * largest;
  g->axes = rotation_of(g->turn, g->real_part);
  g->scale = s;
  g->root.x = product(g->axes.x, s);
  g->root.y = product(g->axes.y, s);
  g->root.z = product(g->axes.z, s);
  g->root_det = s.x * s.y * s.z;
  return meant ? (lanes_int)VISIBLE : (lanes_int)DEGENERATE;
}

#endif

/* What opacity is multiplied with: the line integral through a unit peak, with the dilated
 * screen covariance so that dilation keeps the mass; Mip-Splatting's compensation; or nothing.
 * What an aperture spreads keeps its light, whatever eps2d does. */
static lanes factor_of(const Gaussian *g) {
#if DEFOCUS
  const lanes share = root_of(g->kept * g->inverse);
  return ANTIALIASED ? (g->kept_eps > 0 ? LEAST_COMPENSATION * share : share) : share;
#elif XRAY
  return SQRT_TWO_PI * g->root_det * g->screen.volume * inverse_root(g->dilated);
#elif ANTIALIASED
  return larger(LEAST_COMPENSATION, root_of(g->undilated * g->inverse));
#else
  return 1;
#endif
}

/* Determinant of V V^T + eps I. */
static lanes dilated_determinant(const Gaussian *g, lanes eps) {
  return g->undilated + eps * (dot_of(g->v0, g->v0) + dot_of(g->v1, g->v1)) + eps * eps;
}

/* Project LANES splats; gives VISIBLE, or why not. */
static lanes_int see_gaussian(
    Gaussian *g, Camera camera, __global const float *restrict means, SHAPES, Rows rows,
    float near_plane, float far_plane, float eps2d)
{
  lanes eps = eps2d;
  g->world = read3(means, 3, rows);
  lanes_int code = or_else(read_shape(g, SHAPE, rows), no_numbers(g->world), DEGENERATE);
  const lanes3 point = turned(camera, g->world);
  g->point = lanes3_of(point.x + camera.shift.x, point.y + camera.shift.y, point.z + camera.shift.z);
  code = or_else(code, no_numbers(g->point), DEGENERATE);
  const lanes depth = depth_of(g->point);
  code = or_else(code, (depth < near_plane) | (depth > far_plane), OUT_OF_DEPTH);
  g->screen = to_screen(camera, g->point);
  g->m0 = turned_back(camera, g->screen.du);
  g->m1 = turned_back(camera, g->screen.dv);
  g->v0 = applied_transposed(g->root, g->m0);
  g->v1 = applied_transposed(g->root, g->m1);
  g->normal = cross_of(g->v0, g->v1);
  g->undilated = dot_of(g->normal, g->normal);
  g->kept = g->undilated;
  g->kept_eps = 0;
#if DEFOCUS
  const lanes sharp = dilated_determinant(g, eps);
#if ANTIALIASED
  const lanes_int faded = g->undilated <= LEAST_COMPENSATION * LEAST_COMPENSATION * sharp;
  g->kept = faded ? sharp : g->kept;
  g->kept_eps = faded ? eps : 0;
#else
  g->kept = sharp;
  g->kept_eps = eps;
#endif
  eps += blur_variance(camera, g->point.z);
#endif
  g->eps = eps;
  g->dilated = dilated_determinant(g, eps);
  code = or_else(code, no_number(g->screen.u) | no_number(g->screen.v) | no_number(g->dilated), DEGENERATE);
  code = or_else(code, !(g->dilated > 1 / MOST_AREA) | (g->dilated > MOST_AREA), DEGENERATE);
  if (DEFOCUS) code = or_else(code, !(g->kept > 1 / MOST_AREA), DEGENERATE);
  g->inverse = 1 / g->dilated;
  g->factor = factor_of(g);
  return or_else(code, no_number(g->factor), DEGENERATE);
}

/* Inverse of the dilated screen covariance, times (x, y): its two numbers. */
static lanes conic_x(const Gaussian *g, lanes x, lanes y) {
  return (dot_of(g->v1, minus(times(x, g->v1), times(y, g->v0))) + g->eps * x) * g->inverse;
}

static lanes conic_y(const Gaussian *g, lanes x, lanes y) {
  return (-dot_of(g->v0, minus(times(x, g->v1), times(y, g->v0))) + g->eps * y) * g->inverse;
}
