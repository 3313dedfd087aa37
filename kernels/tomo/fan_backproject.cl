/* A fan's views to an image, pixel by pixel: the transpose of fan_project.
 *
 *     image[y][x] = before + sum over views of weight(b) * sum over bins of share(ray, b, i) * value
 *
 * with the weights and shares of include/tomo/fan_footprint.h; before = image[y][x] if `add` is
 * set, else 0. The first bin in reach is found from the place on the detector at which the pixel's
 * near end is seen, a ratio of linear forms (its angle, where the detector is an arc); shares do not
 * depend on that.
 *
 * Of strips the sum runs over edges: bins before the first have no share, and with y the values
 * and G the part of the pixel before an edge,
 *
 *     sum over bins of y (G[after] - G[before]) = y[last] + sum over edges of (y[before] - y[after]) G.
 *
 * Index space: (runs of LANES pixels of a row, runs of ROWS rows).
 *
 * Buffers: image[height, width], records[count, stride, 4], numbers[first + count, VIEW_NUMBERS]. */

#include "include/portable.h"
#include "include/tomo/fan_footprint.h"
#include "include/lane_quads.h"

#ifndef ROWS
#define ROWS (LANES == 8 ? 16 : 1)
#endif
/* Views that are summed before they are added to the others. Sums of sums round less. */
#define TOGETHER 8
#ifndef CURVED
#define CURVED 0
#endif
/* Farther than any bin. */
#define FAR 1e30f
#if CURVED
#define RIGHT_ANGLE 1.57079633f
/* The angle from ahead of a point so far ahead and across, to 3e-6, behind the source as well: a
 * polynomial through the Chebyshev points of arc tangents below one. */
static lanes angle_of(lanes across, lanes ahead) {
  const lanes a = absolute(across), b = absolute(ahead);
  const lanes t = a < b ? a / b : b / a, v = t * t;
  lanes angle = t *
      (0.99999483f + v * (-0.33295711f + v * (0.19534659f + v * (-0.12044859f +
      v * (0.05658999f - v * 0.01313038f)))));
  angle = a < b ? angle : RIGHT_ANGLE - angle;
  angle = ahead < 0 ? 2 * RIGHT_ANGLE - angle : angle;
  return across < 0 ? -angle : angle;
}
#endif

/* The first ray that a pixel of line `a` reaches in slab s. */
static lanes_int first_ray(lanes a, lanes s, lanes rho, __global const real *view, int bins) {
#if FOOTPRINT == 0
  const lanes slope = (view[MIDDLE_SLOPE] + a * view[INVERSE_DEPTH]) * rho;
  const lanes near = a - view[WIDEST] * (1.0f + absolute(slope));
#else
  const lanes near = a - (view[WIDEST] > rho ? view[WIDEST] / rho : (lanes)1.0f);
#endif
  const lanes across = view[ACROSS] + near * view[ACROSS + 1] + s * view[ACROSS + 2];
  const lanes ahead = 1.0f + near * view[AHEAD] + s * view[AHEAD + 1];
#if CURVED
  lanes place = angle_of(across, ahead) * view[ARC];
#else
  /* What a wide hat reaches beside the source is before all rays. */
  lanes place = ahead > 0 ? across / ahead : -FAR;
#endif
  place = place + view[FIRST_RAY];
  const real least = view[FIRST_SEEN] - 1.0f;
  place = place > least ? place : least;
  place = place < (real)bins ? place : (real)bins;
  return floor_int(place) + 1;
}

/* How many rays a pixel of a slab reaches at most. */
static int rays_in_reach(real rho, __global const real *view) {
  const real spanned = view[RAYS] * rho;
  const real most = spanned > view[LEAST_RAYS] ? spanned : view[LEAST_RAYS];
  return (int)(most < view[MOST_RAYS] - 1 ? most : view[MOST_RAYS] - 1) + 1;
}

/* What a pixel of line `a` has of `count` rays in slab s, the records of which begin `at`. */
static lanes of_rays(
    lanes a, lanes s, lanes rho, __global const real *rays, const int *at, int count)
{
  lanes sum = 0;
#if FOOTPRINT == 0
  lanes last = 0;
#endif
  for (int n = 0; n < count; n++) {
    const lane_quad ray = quads_at(rays + 4 * n, at);
    const lanes z = (ray.s0 + s * ray.s1) - a;
#if FOOTPRINT == 0
    const lanes c = slant_of(ray.s1), half_inverse = 0.5f / c;
    sum = sum + ray.s2 * part_before(z - c, clamped(z, c), clamped(z - 1.0f, c), half_inverse);
    last = ray.s3;
#else
    sum = sum + ray.s3 * hat(z, ray.s2 > rho ? rho / ray.s2 : (lanes)1.0f);
#endif
  }
#if FOOTPRINT == 0
  sum = sum + last;
#endif
  return SLAB_WEIGHT(rho) * sum;
}

KERNEL void fan_backproject(
    __global real *restrict image, __global const real *restrict records,
    __global const real *restrict numbers, int first, int count, int bins, int stride, int height,
    int width, int add)
{
  const int x = (int)get_global_id(0) * LANES, y = (int)get_global_id(1) * ROWS;
  if (x >= width) return;
  /* No loop where an item has one row: Intel's compiler makes wrong numbers of loops that it cannot see
   * to run once, over arrays of one number. */
  const int rows = ROWS == 1 || y + ROWS < height ? ROWS : height - y;
  const lanes column = (real)x + LANE_NUMBERS;
  const real middle_x = (real)0.5f * (width - 1), middle_y = (real)0.5f * (height - 1);
  lanes totals[ROWS], sums[ROWS], depths[ROWS];
  int counts[ROWS];
  int begins[ROWS * LANES] __attribute__((aligned(sizeof(int) * LANES)));
  for (int n = 0; n < rows; n++) totals[n] = sums[n] = 0;
  for (int k = 0; k < count; k++) {
    if (k % TOGETHER == 0)
      for (int n = 0; n < rows; n++) {
        totals[n] = totals[n] + sums[n];
        sums[n] = 0;
      }
    __global const real *view = numbers + (long)(first + k) * VIEW_NUMBERS;
    __global const real *record = records + 4L * k * stride;
    const int along_y = view[ALONG_Y] > 0;
    const real inverse_depth = view[INVERSE_DEPTH];
    if (along_y) {
      for (int n = 0; n < rows; n++) {
        const real rho = 1.0f / (1.0f + (y + n - middle_y) * inverse_depth);
        depths[n] = rho;
        counts[n] = rays_in_reach(rho, view);
      }
    } else {
      const lanes rho = 1.0f / (1.0f + (column - middle_x) * inverse_depth);
      const int reached = rays_in_reach(largest_lane(rho), view);
      for (int n = 0; n < rows; n++) {
        depths[n] = rho;
        counts[n] = reached;
      }
    }
    for (int n = 0; n < rows; n++) {
      const lanes row = (lanes)(real)(y + n), s = along_y ? row - middle_y : column - middle_x;
      const lanes_int ray = first_ray(along_y ? column : row, s, depths[n], view, bins);
      KEEP_INTS(begins + n * LANES, 4 * ray);
    }
    for (int n = 0; n < rows; n++) {
      const lanes row = (lanes)(real)(y + n), s = along_y ? row - middle_y : column - middle_x;
      sums[n] = sums[n] + of_rays(
          along_y ? column : row, s, depths[n], record, begins + n * LANES, counts[n]);
    }
  }
  for (int n = 0; n < rows; n++) {
    __global real *out = image + (long)(y + n) * width + x;
    real sum[LANES] __attribute__((aligned(sizeof(lanes))));
    *(lanes *)sum = totals[n] + sums[n];
    for (int m = 0; m < LANES && x + m < width; m++) out[m] = add ? out[m] + sum[m] : sum[m];
  }
}
