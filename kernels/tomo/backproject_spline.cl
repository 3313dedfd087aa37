/* Backproject every view as the spline of degree DEGREE through its bins.
 *
 *     image[y][x] = sum over views of s(u),   u = offset + y row + x step,
 *
 * s(u) = sum over b of c[b] B(u - b), B the B-spline of degree 0 (the nearest bin) or 3, and zero
 * outside the first and the last bin's centres. `lines` holds offset, row, step of each view, in
 * bins; a view of `coefficients` has one more before its bins and two more after them.
 *
 * Index space: (runs of LANES pixels of a row, rows). Each item goes through all views.
 *
 * Buffers: coefficients[views, bins + BEFORE + AFTER], lines[views, 3], image[along1, nx]. */

#include "include/portable.h"

#ifndef DEGREE
#define DEGREE 3
#endif
#define BEFORE 1
#define AFTER 2
/* What rounding may add to a pixel's place, in bins: one on the edge is not outside. */
#define ROUNDING 1e-4f

#if DEGREE == 0
static lanes spline(__global const float *c, lanes u)
{
  return GATHER(c, floor_int(u + 0.5f));
}
#else
static lanes spline(__global const float *c, lanes u)
{
  const lanes_int b = floor_int(u);
  const lanes f = u - TO_FLOAT(b), g = 1 - f;
  const lanes first = g * g * g / 6, last = f * f * f / 6;
  const lanes second = 2.0f / 3 - f * f * (1 - f / 2);
  const lanes third = 1 - first - second - last;
  return GATHER(c, b - 1) * first + GATHER(c, b) * second +
         GATHER(c, b + 1) * third + GATHER(c, b + 2) * last;
}
#endif

KERNEL void backproject_spline(
    __global const float *restrict coefficients, __global const float *restrict lines,
    __global float *restrict image, int views, int bins, int nx)
{
  const int x = (int)get_global_id(0) * LANES;
  const long y = get_global_id(1);
  if (x >= nx) return;
  const lanes column = (float)x + LANE_NUMBERS, last = (float)(bins - 1) + (lanes)0;
  lanes sum = 0;
  for (int view = 0; view < views; view++) {
    __global const float *c = coefficients + (long)view * (bins + BEFORE + AFTER) + BEFORE;
    const lanes u = lines[3 * view] + lines[3 * view + 1] * (float)y + lines[3 * view + 2] * column;
    const lanes inside = u < 0 ? (lanes)0 : (u > last ? last : u);
    sum = sum + (absolute(u - inside) > ROUNDING ? (lanes)0 : spline(c, inside));
  }
  for (int k = 0; k < LANES && x + k < nx; k++) image[y * nx + x + k] = ((const float *)&sum)[k];
}
