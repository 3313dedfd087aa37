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
 * the aperture at the splat's depth. */

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
  float3 world, point;      /* mean in the world's frame and in the camera's */
  rows3 root;               /* F */
  rows3 axes;               /* R, with quaternions alone */
  float4 quat;              /* (x, y, z, w), normalised */
  float quat_length;
  float3 scale;
  float root_det;           /* |det F| */
  Screen screen;
  float3 m0, m1, v0, v1, normal;
  float undilated, dilated; /* determinants of V V^T and of V V^T + eps I */
  float eps, inverse;       /* inverse of the dilated one */
  float kept, kept_eps;     /* determinant of V V^T + kept_eps I, which the factor is measured by */
  float factor;             /* weight = opacity * factor */
} Gaussian;

static rows3 rotation_of(float4 q) {
  rows3 r;
  r.x = (float3)(1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y - q.w * q.z), 2 * (q.x * q.z + q.w * q.y));
  r.y = (float3)(2 * (q.x * q.y + q.w * q.z), 1 - 2 * (q.x * q.x + q.z * q.z), 2 * (q.y * q.z - q.w * q.x));
  r.z = (float3)(2 * (q.x * q.z - q.w * q.y), 2 * (q.y * q.z + q.w * q.x), 1 - 2 * (q.x * q.x + q.y * q.y));
  return r;
}

static float larger(float a, float b) { return a > b ? a : b; }

#if COVARIANCES

/* One column of Cholesky's factor below its pivot; zero where the pivot is nothing but rounding. */
static int pivot_is_valid(float pivot, float below, float trace, float *diagonal) {
  *diagonal = pivot > ROUNDING * trace ? sqrt(pivot) : 0;
  return *diagonal > 0 || (pivot > -ROUNDING * trace && below < 1e-3f * trace);
}

static int read_shape(Gaussian *g, SHAPES, long i) {
  const float3 a = load3(covars, 2 * i), b = load3(covars, 2 * i + 1);
  if (not_finite3(a) | not_finite3(b)) return DEGENERATE;
  const float trace = a.x + b.x + b.z;
  float l0, l1, l2;
  if (not_finite(trace) || !(trace > 0)) return DEGENERATE;
  if (!pivot_is_valid(a.x, larger(absolute1(a.y), absolute1(a.z)), trace, &l0)) return DEGENERATE;
  const float l10 = l0 > 0 ? a.y / l0 : 0, l20 = l0 > 0 ? a.z / l0 : 0;
  const float rest = b.y - l20 * l10;
  if (!pivot_is_valid(b.x - l10 * l10, absolute1(rest), trace, &l1)) return DEGENERATE;
  const float l21 = l1 > 0 ? rest / l1 : 0;
  if (!pivot_is_valid(b.z - l20 * l20 - l21 * l21, 0, trace, &l2)) return DEGENERATE;
  g->root.x = (float3)(l0, 0, 0);
  g->root.y = (float3)(l10, l1, 0);
  g->root.z = (float3)(l20, l21, l2);
  g->root_det = l0 * l1 * l2;
  return VISIBLE;
}

#else

static int read_shape(Gaussian *g, SHAPES, long i) {
  __global const float *q = quats + 4 * i;
  const float w = q[0];
  const float3 xyz = (float3)(q[1], q[2], q[3]), s = load3(scales, i);
  if (not_finite(w) | not_finite3(xyz) | not_finite3(s)) return DEGENERATE;
  const float largest = larger(larger(absolute1(w), absolute1(xyz.x)), larger(absolute1(xyz.y), absolute1(xyz.z)));
  if (!(largest > LEAST_QUATERNION) || !(s.x > 0) || !(s.y > 0) || !(s.z > 0)) return DEGENERATE;
  const float4 even = (float4)(xyz, w) * (1 / largest);
  const float length = sqrt(dot3(even.xyz, even.xyz) + even.w * even.w);
  g->quat = even * (1 / length);
  g->quat_length = length * largest;
  g->axes = rotation_of(g->quat);
  g->scale = s;
  g->root.x = g->axes.x * s;
  g->root.y = g->axes.y * s;
  g->root.z = g->axes.z * s;
  g->root_det = s.x * s.y * s.z;
  return VISIBLE;
}

#endif

/* What opacity is multiplied with: the line integral through a unit peak, with the dilated
 * screen covariance so that dilation keeps the mass; Mip-Splatting's compensation; or nothing.
 * What an aperture spreads keeps its light, whatever eps2d does. */
static float factor_of(const Gaussian *g) {
#if DEFOCUS
  return sqrt(g->kept / g->dilated) * (ANTIALIASED && g->kept_eps > 0 ? LEAST_COMPENSATION : 1);
#elif XRAY
  return SQRT_TWO_PI * g->root_det * g->screen.volume / sqrt(g->dilated);
#elif ANTIALIASED
  return larger(LEAST_COMPENSATION, sqrt(g->undilated / g->dilated));
#else
  return 1;
#endif
}

/* Determinant of V V^T + eps I. */
static float dilated_determinant(const Gaussian *g, float eps) {
  return g->undilated + eps * (dot3(g->v0, g->v0) + dot3(g->v1, g->v1)) + eps * eps;
}

/* Project splat i; gives VISIBLE, or why not. */
static int see_gaussian(
    Gaussian *g, Camera camera, __global const float *restrict means, SHAPES, long i,
    float near_plane, float far_plane, float eps)
{
  g->world = load3(means, i);
  if (not_finite3(g->world) || read_shape(g, SHAPE, i) != VISIBLE) return DEGENERATE;
  g->point = apply3(camera.rotation, g->world) + camera.shift;
  if (not_finite3(g->point)) return DEGENERATE;
  if (g->point.z < near_plane || g->point.z > far_plane) return OUT_OF_DEPTH;
  g->screen = to_screen(camera, g->point);
  g->m0 = apply_transposed3(camera.rotation, g->screen.du);
  g->m1 = apply_transposed3(camera.rotation, g->screen.dv);
  g->v0 = apply_transposed3(g->root, g->m0);
  g->v1 = apply_transposed3(g->root, g->m1);
  g->normal = cross3(g->v0, g->v1);
  g->undilated = dot3(g->normal, g->normal);
  g->kept = g->undilated;
  g->kept_eps = 0;
#if DEFOCUS
  const float sharp = dilated_determinant(g, eps);
  if (!ANTIALIASED || g->undilated <= LEAST_COMPENSATION * LEAST_COMPENSATION * sharp) {
    g->kept = sharp;
    g->kept_eps = eps;
  }
  eps += blur_variance(camera, g->point.z);
#endif
  g->eps = eps;
  g->dilated = dilated_determinant(g, eps);
  if (not_finite(g->screen.u) || not_finite(g->screen.v) || not_finite(g->dilated)) return DEGENERATE;
  if (!(g->dilated > 1 / MOST_AREA) || g->dilated > MOST_AREA) return DEGENERATE;
  if (DEFOCUS && !(g->kept > 1 / MOST_AREA)) return DEGENERATE;
  g->inverse = 1 / g->dilated;
  g->factor = factor_of(g);
  return not_finite(g->factor) ? DEGENERATE : VISIBLE;
}

/* Inverse of the dilated screen covariance, times w. */
static float2 apply_conic(const Gaussian *g, float2 w) {
  const float3 k = w.x * g->v1 - w.y * g->v0;
  return ((float2)(dot3(g->v1, k), -dot3(g->v0, k)) + g->eps * w) * g->inverse;
}
