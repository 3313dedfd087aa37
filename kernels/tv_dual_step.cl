/* One step of the dual field of total variation, pulled back into its ball.
 *
 *     moved = P(u + step D x),    P(v) = v / max(1, |v| / radius) at every sample,
 *
 * |v| over the axes, which makes the variation isotropic. `moved` may be u itself.
 * From u = 0 with step 1 and no bound on the radius it is the gradient D x.
 *
 * Index space: (runs of RUN samples along x, y, z). */

#include "include/portable.h"
#include "include/differences.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void tv_dual_step(
    __global const real *u, __global const real *image, __global real *moved,
    int nz, int ny, int nx, real step_z, real step_y, real step_x, real radius)
{
  const int y = get_global_id(1), z = get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < nx ? begin + RUN : nx;
  const real steps[3] = {step_z, step_y, step_x};
  for (int x = begin; x < end; x++) {
    const Place p = place_of(x, y, z, nz, ny, nx);
    real v[AXES], square = 0;
    UNROLL for (int k = 0; k < AXES; k++) {
      const int a = k + 3 - AXES;
      v[k] = u[k * p.size + p.at] + steps[a] * difference(image, &p, a);
      square += v[k] * v[k];
    }
    /* 1 inside the ball, where the ratio is more, or not a number of two zeros; not a choice whether
     * to divide, which would be mispredicted on noise. */
    const real ratio = radius / sqrt(square), share = ratio < 1 ? ratio : 1;
    UNROLL for (int k = 0; k < AXES; k++) moved[k * p.size + p.at] = share * v[k];
  }
}
