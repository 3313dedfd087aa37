/* |D x| at every sample: its sum is the total variation.
 *
 * If DIRECTIONAL, D x is weighed by its direction first (see differences.h).
 * Index space: (runs of RUN samples along x, y, z).
 *
 * Buffers: image, magnitude[nz, ny, nx]. */

#include "include/portable.h"
#include "include/tomo/differences.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

KERNEL void tv_magnitude(
    __global const real *image, __global real *magnitude,
    int nz, int ny, int nx, real step_z, real step_y, real step_x,
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
    UNROLL for (int k = 0; k < AXES; k++) square += v[k] * v[k];
    magnitude[p.at] = sqrt(square);
  }
}
