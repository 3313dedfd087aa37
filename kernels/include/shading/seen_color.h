/* Colours by the direction that a splat is seen in: what harmonics and lobes share.
 *
 * The direction is mean - camera, unit; (0, 0, 1) where the camera stands in the mean, or nearer
 * than 1e-19. Of the sum of functions a colour is what is above zero, and black where it is not
 * finite. On the way back a colour that was held at zero passes nothing on. Only the direction's
 * change across itself counts, so that a gradient g by it gives dL/dmean = (g - (g . d) d) /
 * distance. The camera stands at o = -W^-1 t, so with dL/do = -dL/dmean its gradient gains
 *
 *     dL/dt = W^-T dL/dmean,      dL/dW = (W^-T dL/dmean) o^T,
 *
 * which is linear: a work-item sums dL/dmean over its splats and adds this once, to its own row of
 * camera_parts.
 *
 * With PARALLEL 1 the rays of the camera are parallel: every splat is seen in the direction of its axis
 * a, the third row of W, which comes in place of o. No mean changes it; dL/da = g - (g . d) d is
 * summed instead, and is added to that row of dL/dW.
 *
 * Coefficients are 3 FUNCTIONS numbers in a splat's row, three channels to a function. Four functions
 * are twelve numbers, three whole fours of columns (splat_rows.h), and go through registers at once.
 * Tables of features have STRIDE numbers for each splat, of which the first three are the colour. */

#include "include/splat/splat_rows.h"
#include "include/train/adam_step.h"

#ifndef STRIDE
#define STRIDE 3
#endif
/* Whether a gradient's kernel takes a step of Adam along the coefficients and writes no gradient by them. */
#ifndef ADAM
#define ADAM 0
#endif
#ifndef CAMERA_GRADIENT
#define CAMERA_GRADIENT 1
#endif
#ifndef LIT
#define LIT 0
#endif
#ifndef PARALLEL
#define PARALLEL 0
#endif
/* Functions, and columns, that go through registers at once. */
#define AT_ONCE 4
#define NUMBERS_AT_ONCE 12

/* The direction that splats are seen in, and one over their distance (1 where rays are parallel). */
typedef struct {
  lanes3 direction;
  lanes inverse;
} Sight;

static Sight sight_of(lanes3 mean, float3 center) {
#if PARALLEL
  Sight s;
  s.inverse = 1;
  s.direction = lanes3_of(center.x, center.y, center.z);
  return s;
#else
  const lanes3 away = lanes3_of(mean.x - center.x, mean.y - center.y, mean.z - center.z);
  const lanes square = dot_of(away, away);
  const lanes_int apart = (square > LEAST_SQUARE) & (square < MOST_SQUARE);
  Sight s;
  s.inverse = apart ? inverse_root(square) : 0;
  s.direction = lanes3_of(
      apart ? away.x * s.inverse : 0, apart ? away.y * s.inverse : 0, apart ? away.z * s.inverse : 1);
  return s;
#endif
}

/* Asks for the coefficients of the splats after the next LANES: a row of harmonics is three lines of
 * memory, and eight rows are more than the hardware looks ahead for by itself. */
#define NUMBERS_OF_LINE 16
static void ask_ahead(__global const float *coefficients, const int functions, Rows rows) {
#if LANES == 8 && RIFT_POCL
  __global const float *p = coefficients + (rows.first + 2 * LANES) * 3 * functions;
  for (int k = 0; k < LANES * 3 * functions; k += NUMBERS_OF_LINE) PREFETCH(p + k);
#endif
}

/* A half, and the sum of functions times coefficients. */
static lanes3 sum_of_functions(
    __global const float *coefficients, const int functions, Rows rows, const lanes *basis)
{
  lanes x = 0.5f, y = 0.5f, z = 0.5f;
  UNROLL for (int k = 0; k < functions; k += AT_ONCE) {
    const int some = functions - k < AT_ONCE ? functions - k : AT_ONCE;
    lanes v[NUMBERS_AT_ONCE];
    read_columns(coefficients, 3 * functions, 3 * k, 3 * some, rows, v);
    UNROLL for (int n = 0; n < some; n++) {
      x += basis[k + n] * v[3 * n];
      y += basis[k + n] * v[3 * n + 1];
      z += basis[k + n] * v[3 * n + 2];
    }
  }
  return lanes3_of(x, y, z);
}

/* A sum, with the light that a splat reflects where features hold that already. */
static lanes3 lit(lanes3 sum, __global const float *features, Rows rows) {
#if LIT
  return plus(sum, read3(features, STRIDE, rows));
#else
  return sum;
#endif
}

/* The colour of a sum, where a splat is drawn. */
static lanes3 color_of(lanes3 sum, lanes_int drawn) {
  const lanes_int shown = drawn & !no_numbers(sum);
  return lanes3_of(
      (shown & (sum.x > 0)) ? sum.x : 0, (shown & (sum.y > 0)) ? sum.y : 0,
      (shown & (sum.z > 0)) ? sum.z : 0);
}

static lanes_int is_seen(lanes3 color) { return (color.x > 0) | (color.y > 0) | (color.z > 0); }

/* What comes in of a colour's gradient. */
static lanes3 incoming_of(lanes3 color, lanes3 grad) {
  return lanes3_of(color.x > 0 ? grad.x : 0, color.y > 0 ? grad.y : 0, color.z > 0 ? grad.z : 0);
}

/* dL/d(functions), from what comes in of a colour's gradient. */
static void functions_grad(
    __global const float *coefficients, const int functions, Rows rows, lanes3 incoming, lanes *by_basis)
{
  UNROLL for (int k = 0; k < functions; k += AT_ONCE) {
    const int some = functions - k < AT_ONCE ? functions - k : AT_ONCE;
    lanes v[NUMBERS_AT_ONCE];
    read_columns(coefficients, 3 * functions, 3 * k, 3 * some, rows, v);
    UNROLL for (int n = 0; n < some; n++)
      by_basis[k + n] = dot_of(incoming, lanes3_of(v[3 * n], v[3 * n + 1], v[3 * n + 2]));
  }
}

/* dL/d(coefficients), as LANES rows in memory of the work-item's own. */
static void coefficients_grad(const int functions, const lanes *basis, lanes3 incoming, lanes *by) {
  UNROLL for (int k = 0; k < functions; k += AT_ONCE) {
    const int some = functions - k < AT_ONCE ? functions - k : AT_ONCE;
    lanes v[NUMBERS_AT_ONCE];
    UNROLL for (int n = 0; n < some; n++) {
      v[3 * n] = basis[k + n] * incoming.x;
      v[3 * n + 1] = basis[k + n] * incoming.y;
      v[3 * n + 2] = basis[k + n] * incoming.z;
    }
    keep_columns(by, 3 * functions, 3 * k, 3 * some, v);
  }
}

#if ADAM
/* A step of Adam along the coefficients of splats, by what coefficients_grad found. */
static void step_coefficients(
    __global float *coefficients, const int functions, Rows rows, const lanes *by, Adam adam)
{
  const int numbers = 3 * functions * (LANES == 1 ? 1 : rows.count);
  adam_along(coefficients, adam, (ulong)rows.first * 3 * functions, numbers, by);
}
#endif

/* dL/dmean, or dL/da, from the gradient g by the direction, where a splat is seen. */
static lanes3 mean_grad(lanes3 g, Sight s, lanes_int seen) {
  return where(seen, times(s.inverse, minus(g, times(dot_of(g, s.direction), s.direction))));
}

static void add_to_means(__global float *grad_means, Rows rows, lanes3 by_mean) {
#if !PARALLEL
  write3(grad_means, 3, rows, plus(read3(grad_means, 3, rows), by_mean));
#endif
}

/* Adds what a work-item's sum of dL/dmean, or of dL/da, is worth by the camera; x, y, z are the rows of W^-T, each
 * followed by a coordinate of o. */
static void add_to_camera(lanes3 by_means, float4 x, float4 y, float4 z, __global float *camera_parts) {
#if CAMERA_GRADIENT
  const float3 by = (float3)(SUM_OF_LANES(by_means.x), SUM_OF_LANES(by_means.y), SUM_OF_LANES(by_means.z));
  __global float *part = camera_parts + 16 * (long)get_global_id(0);
#if PARALLEL
  part[8] += by.x;
  part[9] += by.y;
  part[10] += by.z;
#else
  const float shift[3] = {
      x.x * by.x + x.y * by.y + x.z * by.z, y.x * by.x + y.y * by.y + y.z * by.z,
      z.x * by.x + z.y * by.y + z.z * by.z};
  for (int k = 0; k < 3; k++, part += 4) {
    part[0] += shift[k] * x.w;
    part[1] += shift[k] * y.w;
    part[2] += shift[k] * z.w;
    part[3] += shift[k];
  }
#endif
#endif
}
