/* The gradient of a number E by views, from its gradient by the coverage (coverage.cl).
 *
 * Each work-item sums over RUN frequencies for one view and point, so that no sum depends on how
 * the work is cut: parts[part][point][view] holds the gradient by n (across n), weight, pixel,
 * 1 / cutoff and blur. With M the transfer, dE/dn sums dE/du (k - u n), where
 *
 *     dE/du = 2 w rho^2 M (-8 u M - M' u / |k_perp|) dE/dL,    M' = dM / d|k_perp|.
 *
 * Index space: (views, points, parts of RUN frequencies).
 *
 * Buffers: frequencies[3, count], boxes[count / LANES, 6], views[point_count, view_count, ROW],
 * upstream[point_count, count], parts[along2, point_count, view_count, ROW]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/sampling/coverage.h"

#ifndef RUN
#define RUN 1024
#endif

KERNEL void coverage_grad(
    __global const float *restrict frequencies, __global const float *restrict boxes,
    __global const float *restrict views, __global const float *restrict upstream,
    __global float *restrict parts, int count, int view_count,
    int point_count)
{
  const int v = get_global_id(0);
  if (v >= view_count) return;
  const int point = get_global_id(1), part = get_global_id(2);
  const long row = (long)point * view_count + v;
  __global const float *view = views + row * ROW;
  const float weight = view[3], pixel = view[4], inverse = view[5], blur = view[6];
  const int begin = part * RUN, end = begin + RUN < count ? begin + RUN : count;
  lanes gx = 0, gy = 0, gz = 0, by_weight = 0, by_pixel = 0, by_inverse = 0, by_blur = 0;
  for (int k0 = begin; k0 < end; k0 += LANES) {
    const lanes kx = LOAD(frequencies + k0), ky = LOAD(frequencies + count + k0);
    const lanes kz = LOAD(frequencies + 2 * (long)count + k0);
    if (!NEAR(view, boxes, k0 / LANES, kx, ky, kz)) continue;
    const slab s = slab_of(view, kx, ky, kz);
    const lanes g = LOAD(upstream + (long)point * count + k0) * s.window;
    lanes light = 1, light_slope = 0, square = 1, square_slope = 0, disc = 1, disc_slope = 0;
    if (inverse > 0) {
      light = diffraction(s.across * inverse);
      light_slope = diffraction_slope(s.across * inverse);
    }
    if (pixel > 0) {
      const lanes t = at_least(s.across * pixel, LEAST);
      const half_turn h = half_turn_of(t);
      square = square_pixel(h, t);
      square_slope = square_pixel_slope(h, t);
    }
    if (blur > 0) {
      const lanes t = at_least(s.across * blur * (1 - s.across * inverse), LEAST);
      const half_turn h = half_turn_of(t);
      disc = defocus(h, t);
      disc_slope = defocus_slope(h, t);
    }
    light_slope *= square * disc;
    square_slope *= light * disc;
    disc_slope *= light * square;
    const lanes passed = light * square * disc, by_passed = 2 * weight * g * passed;
    by_weight += g * passed * passed;
    by_pixel += by_passed * square_slope * s.across;
    by_inverse += by_passed * (light_slope - disc_slope * blur * s.across) * s.across;
    by_blur += by_passed * disc_slope * s.across * (1 - s.across * inverse);
    const lanes slope = square_slope * pixel + light_slope * inverse
        + disc_slope * blur * (1 - 2 * s.across * inverse);
    const lanes by_u = -s.u * by_passed * (8 * passed + slope / at_least(s.across, LEAST));
    gx += by_u * s.x;
    gy += by_u * s.y;
    gz += by_u * s.z;
  }
  __global float *out = parts + ((long)part * point_count * view_count + row) * ROW;
  out[0] = SUM_OF_LANES(gx);
  out[1] = SUM_OF_LANES(gy);
  out[2] = SUM_OF_LANES(gz);
  out[3] = SUM_OF_LANES(by_weight);
  out[4] = SUM_OF_LANES(by_pixel);
  out[5] = SUM_OF_LANES(by_inverse);
  out[6] = SUM_OF_LANES(by_blur);
  out[7] = 0;
}
