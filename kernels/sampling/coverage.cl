/* How well views sample frequencies of a target, at points of it:
 *
 *     L(k) = sum over views of w MTF(|k_perp|)^2 rho(n . k)^2,      k_perp = k - (n . k) n,
 *
 * in the units of include/sampling/coverage.h, where a view that is far from a block of frequencies
 * is skipped. `count` is a whole number of LANES. Views are summed in their order.
 *
 * Index space: (blocks of LANES frequencies, points).
 *
 * Buffers: frequencies[3, count], boxes[count / LANES, 6], views[along1, view_count, ROW],
 * covered[along1, count]. */

#include "include/portable.h"
#include "include/sampling/coverage.h"

KERNEL void coverage(
    __global const float *restrict frequencies, __global const float *restrict boxes,
    __global const float *restrict views, __global float *restrict covered, int count, int view_count)
{
  const int block = get_global_id(0), k0 = block * LANES;
  if (k0 >= count) return;
  const int point = get_global_id(1);
  const lanes kx = LOAD(frequencies + k0), ky = LOAD(frequencies + count + k0);
  const lanes kz = LOAD(frequencies + 2 * (long)count + k0);
  lanes sum = 0;
  for (int v = 0; v < view_count; v++) {
    __global const float *view = views + ((long)point * view_count + v) * ROW;
    if (!NEAR(view, boxes, block, kx, ky, kz) || view[3] == 0) continue;
    const slab s = slab_of(view, kx, ky, kz);
    lanes passed = 1;
    if (view[5] > 0) passed = diffraction(s.across * view[5]);
    if (view[4] > 0) {
      const lanes t = at_least(s.across * view[4], LEAST);
      passed *= square_pixel(half_turn_of(t), t);
    }
    if (view[6] > 0) {
      const lanes t = at_least(s.across * view[6] * (1 - s.across * view[5]), LEAST);
      passed *= defocus(half_turn_of(t), t);
    }
    sum += view[3] * s.window * passed * passed;
  }
  STORE(covered + (long)point * count + k0, sum);
}
