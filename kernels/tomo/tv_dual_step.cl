/* One step of the dual field of total variation, pulled back into its ball.
 *
 *     moved = P(u + step D x),    P(v) = v / max(1, |v| / radius) at every sample,
 *
 * |v| over the axes, which makes the variation isotropic; if DIRECTIONAL, D x is weighed by its
 * direction first (see differences.h). `moved` may be u itself.
 * From u = 0 with step 1 and no bound on the radius it is the gradient D x.
 *
 * Index space: (runs of RUN samples along x, y, z).
 *
 * Buffers: image[nz, ny, nx], u, moved[AXES, nz, ny, nx]. */

#include "include/portable.h"
#include "include/tomo/differences.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void tv_dual_step(
    __global const real *u, __global const real *image, __global real *moved,
    int nz, int ny, int nx, real step_z, real step_y, real step_x, real radius,
    real m_yy, real m_yx, real m_xx)
{
  const int y = get_global_id(1), z = get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < nx ? begin + RUN : nx;
  const real steps[3] = {step_z, step_y, step_x};
  for (int x = begin; x < end; x++) {
    const Place p = place_of(x, y, z, nz, ny, nx);
    real v[AXES], square = 0;
    UNROLL for (int k = 0; k < AXES; k++)
      v[k] = steps[k + 3 - AXES] * difference(image, &p, k + 3 - AXES);
    if (DIRECTIONAL) weigh_direction(v, m_yy, m_yx, m_xx);
    UNROLL for (int k = 0; k < AXES; k++) {
      v[k] += u[k * p.size + p.at];
      square += v[k] * v[k];
    }
    /* 1 inside the ball, where the ratio is more, or not a number of two zeros; not a choice whether
     * to divide, which would be mispredicted on noise. */
    const real ratio = radius / sqrt(square), share = ratio < 1 ? ratio : 1;
    UNROLL for (int k = 0; k < AXES; k++) moved[k * p.size + p.at] = share * v[k];
  }
}
