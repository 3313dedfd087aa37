/* How a camera maps a point to the screen, how its map bends there, and the gradient of both.
 *
 * q = (x, y, z) is a point in the camera's frame (x right, y down, z forward), (u, v) its pixel
 * position and J the 2x3 matrix of their derivatives, whose rows are `du` and `dv`:
 *
 *     pinhole   u = fx x / z + cx,
 *     ortho     u = fx x + cx,
 *     fisheye   u = fx x s + cx,   s = theta / r, r = |(x, y)|, theta = atan2(r, z),
 *
 * and the same for v with y. A pinhole's J is taken at most 15 % of the image outside of it, as
 * gsplat and inria do: far outside, the local affine map stretches a splat without bound. In
 * pixels that is px = clamp(u, -0.15 W, 1.15 W) - cx, with du = (fx, 0, -px) / z.
 *
 * A splat's depth, by which it is culled and drawn front to back, is z, and for a fisheye |q|: its
 * rays go round by up to half a turn, and z is no distance beyond a quarter. On the axis behind a
 * fisheye s has no limit, and what is there is not drawn.
 *
 * `volume` is det [du; dv; ray] with the unit ray along which J sees (its null direction): pixel
 * area times length along the ray, per unit of volume. Line integrals need it.
 * With DEFOCUS a camera has an aperture besides: see aperture.h. The camera is the same for all lanes,
 * points have LANES places. */

#include "include/lane_vectors.h"

#define PINHOLE 0
#define ORTHO 1
#define FISHEYE 2
#ifndef MODEL
#define MODEL PINHOLE
#endif
#ifndef DEFOCUS
#define DEFOCUS 0
#endif
#define MARGIN 0.15f

/* Rows of the world-to-camera matrix, then (fx, fy, cx, cy), then the image, then (R, 1/F, L). */
#define PINHOLE_PARAMETERS \
  float4 view_x, float4 view_y, float4 view_z, float4 intrinsics, int width, int height
#define PINHOLE_CAMERA \
  camera_of(view_x, view_y, view_z, intrinsics, (float)width, (float)height)
#if DEFOCUS
#define CAMERA_PARAMETERS PINHOLE_PARAMETERS, float4 aperture
#define CAMERA with_aperture(PINHOLE_CAMERA, aperture)
#else
#define CAMERA_PARAMETERS PINHOLE_PARAMETERS
#define CAMERA PINHOLE_CAMERA
#endif

typedef struct {
  float3 turn_x, turn_y, turn_z; /* rows of the rotation */
  float3 shift;
  float fx, fy, cx, cy, width, height;
#if DEFOCUS
  float radius, inverse_focus, diffraction;
#endif
} Camera;

typedef struct {
  lanes u, v, volume;
  lanes3 du, dv;
} Screen;

/* dL/d of a Screen's members; of the volume, by its logarithm. */
typedef struct {
  lanes u, v, log_volume;
  lanes3 du, dv;
} ScreenGradient;

typedef struct {
  lanes3 point;
  lanes fx, fy, cx, cy;
#if DEFOCUS
  lanes radius, focus;
#endif
} CameraGradient;

static Camera camera_of(
    float4 row_x, float4 row_y, float4 row_z, float4 intrinsics, float width, float height) {
  Camera c;
  c.turn_x = row_x.xyz;
  c.turn_y = row_y.xyz;
  c.turn_z = row_z.xyz;
  c.shift = (float3)(row_x.w, row_y.w, row_z.w);
  c.fx = intrinsics.x;
  c.fy = intrinsics.y;
  c.cx = intrinsics.z;
  c.cy = intrinsics.w;
  c.width = width;
  c.height = height;
  return c;
}

/* Into the camera's axes, and back. */
static lanes3 turned(Camera c, lanes3 v) {
  return lanes3_of(dot_with(c.turn_x, v), dot_with(c.turn_y, v), dot_with(c.turn_z, v));
}

static lanes3 turned_back(Camera c, lanes3 v) {
  return lanes3_of(
      v.x * c.turn_x.x + v.y * c.turn_y.x + v.z * c.turn_z.x,
      v.x * c.turn_x.y + v.y * c.turn_y.y + v.z * c.turn_z.y,
      v.x * c.turn_x.z + v.y * c.turn_y.z + v.z * c.turn_z.z);
}

/* Depth of a point, and its gradient. */
#if MODEL == FISHEYE
static lanes depth_of(lanes3 q) { return root_of(dot_of(q, q)); }

static void add_depth_grad(lanes3 q, lanes depth, CameraGradient *out) {
  out->point = plus(out->point, times(depth / depth_of(q), q));
}
#else
static lanes depth_of(lanes3 q) { return q.z; }

static void add_depth_grad(lanes3 q, lanes depth, CameraGradient *out) { out->point.z += depth; }
#endif

#if MODEL == PINHOLE

/* Offset from the principal point, kept near the image. */
static lanes near_image(lanes offset, float center, float size) {
  const float low = -MARGIN * size - center, high = (1 + MARGIN) * size - center;
  const lanes right = offset < low ? low : offset;
  return right > high ? high : right;
}

static Screen to_screen(Camera c, lanes3 q) {
  const lanes inverse = 1 / q.z, x = c.fx * q.x * inverse, y = c.fy * q.y * inverse;
  const lanes px = near_image(x, c.cx, c.width), py = near_image(y, c.cy, c.height);
  const lanes tx = px * (1 / c.fx), ty = py * (1 / c.fy);
  Screen s;
  s.u = x + c.cx;
  s.v = y + c.cy;
  s.du = lanes3_of(c.fx * inverse, 0, -px * inverse);
  s.dv = lanes3_of(0, c.fy * inverse, -py * inverse);
  s.volume = c.fx * inverse * c.fy * inverse * root_of(1 + tx * tx + ty * ty);
  return s;
}

static CameraGradient to_screen_grad(Camera c, lanes3 q, ScreenGradient g) {
  const float per_fx = 1 / c.fx, per_fy = 1 / c.fy;
  const lanes inverse = 1 / q.z, x = q.x * inverse, y = q.y * inverse;
  const lanes free_x = c.fx * x, free_y = c.fy * y;
  const lanes px = near_image(free_x, c.cx, c.width), py = near_image(free_y, c.cy, c.height);
  const lanes tx = px * per_fx, ty = py * per_fy;
  const lanes stretch = g.log_volume / (1 + tx * tx + ty * ty);
  /* By a place that is held at a bound: the bound moves with the principal point alone. */
  const lanes_int held_x = px != free_x, held_y = py != free_y;
  const lanes by_px = -g.du.z * inverse + stretch * tx * per_fx;
  const lanes by_py = -g.dv.z * inverse + stretch * ty * per_fy;
  const lanes gx = g.u + (held_x ? 0 : by_px), gy = g.v + (held_y ? 0 : by_py);
  CameraGradient out;
  out.cx = g.u - (held_x ? by_px : 0);
  out.cy = g.v - (held_y ? by_py : 0);
  out.fx = g.du.x * inverse + gx * x + (g.log_volume - stretch * tx * tx) * per_fx;
  out.fy = g.dv.y * inverse + gy * y + (g.log_volume - stretch * ty * ty) * per_fy;
  out.point.x = gx * c.fx * inverse;
  out.point.y = gy * c.fy * inverse;
  out.point.z = -(out.point.x * x + out.point.y * y) - 2 * g.log_volume * inverse
      + (g.du.z * px + g.dv.z * py - g.du.x * c.fx - g.dv.y * c.fy) * inverse * inverse;
  return out;
}

#elif MODEL == ORTHO

static Screen to_screen(Camera c, lanes3 q) {
  Screen s;
  s.u = c.fx * q.x + c.cx;
  s.v = c.fy * q.y + c.cy;
  s.du = lanes3_of(c.fx, 0, 0);
  s.dv = lanes3_of(0, c.fy, 0);
  s.volume = c.fx * c.fy;
  return s;
}

static CameraGradient to_screen_grad(Camera c, lanes3 q, ScreenGradient g) {
  CameraGradient out;
  out.point = lanes3_of(g.u * c.fx, g.v * c.fy, 0);
  out.fx = g.u * q.x + g.du.x + g.log_volume / c.fx;
  out.fy = g.v * q.y + g.dv.y + g.log_volume / c.fy;
  out.cx = g.u;
  out.cy = g.v;
  return out;
}

#else

/* s = theta / r and its derivatives by w = r^2: ds/dw = s1 / 2, ds1/dw = s2; m = 1 / |q|^2.
 * Near the axis the closed forms cancel, and series in t = w / z^2 take their place:
 * z s = sum (-t)^n / (2 n + 1). */
typedef struct {
  lanes s, s1, s2, m;
} Bend;

#define SERIES 10
#define SERIES_BELOW 0.1f

static Bend bend_of(lanes3 q) {
  const lanes w = q.x * q.x + q.y * q.y, i = 1 / q.z, t = w * i * i;
  const lanes_int close = (q.z > 0) & (t < SERIES_BELOW);
  Bend b;
  b.m = 1 / (w + q.z * q.z);
  b.s = b.s1 = b.s2 = 0;
  UNROLL for (int n = SERIES; n >= 0; n--) b.s = 1.0f / (2 * n + 1) - t * b.s;
  UNROLL for (int n = SERIES; n >= 1; n--) b.s1 = 2.0f * n / (2 * n + 1) - t * b.s1;
  UNROLL for (int n = SERIES; n >= 2; n--) b.s2 = 2.0f * n * (n - 1) / (2 * n + 1) - t * b.s2;
  b.s *= i;
  b.s1 *= -i * i * i;
  b.s2 *= i * i * i * i * i;
  if (any_lane(!close)) {
    const lanes r = root_of(w), s = atan2(r, q.z) / r, s1 = (q.z * b.m - s) / w;
    b.s = close ? b.s : s;
    b.s1 = close ? b.s1 : s1;
    b.s2 = close ? b.s2 : -(q.z * b.m * b.m + 1.5f * s1) / w;
  }
  return b;
}

static Screen to_screen(Camera c, lanes3 q) {
  const Bend b = bend_of(q);
  const lanes cross = q.x * q.y * b.s1;
  Screen s;
  s.u = c.fx * q.x * b.s + c.cx;
  s.v = c.fy * q.y * b.s + c.cy;
  s.du = times(c.fx, lanes3_of(b.s + q.x * q.x * b.s1, cross, -q.x * b.m));
  s.dv = times(c.fy, lanes3_of(cross, b.s + q.y * q.y * b.s1, -q.y * b.m));
  s.volume = 0; /* no line integrals */
  return s;
}

static CameraGradient to_screen_grad(Camera c, lanes3 q, ScreenGradient g) {
  const Bend b = bend_of(q);
  const lanes3 gu = times(c.fx, g.du), gv = times(c.fy, g.dv);
  CameraGradient out;
  out.cx = g.u;
  out.cy = g.v;
  out.fx = g.u * q.x * b.s + g.du.x * (b.s + q.x * q.x * b.s1) + g.du.y * q.x * q.y * b.s1
      - g.du.z * q.x * b.m;
  out.fy = g.v * q.y * b.s + g.dv.x * q.x * q.y * b.s1 + g.dv.y * (b.s + q.y * q.y * b.s1)
      - g.dv.z * q.y * b.m;
  const lanes cross = gu.y + gv.x;
  const lanes gs = g.u * c.fx * q.x + g.v * c.fy * q.y + gu.x + gv.y;
  const lanes gs1 = gu.x * q.x * q.x + cross * q.x * q.y + gv.y * q.y * q.y;
  const lanes gm = -gu.z * q.x - gv.z * q.y;
  /* By w, of which x and y get twice themselves. */
  const lanes gw = gs * b.s1 + 2 * gs1 * b.s2 - 2 * gm * b.m * b.m;
  out.point.x = g.u * c.fx * b.s + (2 * gu.x * q.x + cross * q.y) * b.s1 - gu.z * b.m + gw * q.x;
  out.point.y = g.v * c.fy * b.s + (2 * gv.y * q.y + cross * q.x) * b.s1 - gv.z * b.m + gw * q.y;
  out.point.z = -gs * b.m + 2 * gs1 * b.m * b.m - 2 * gm * q.z * b.m * b.m;
  return out;
}

#endif
