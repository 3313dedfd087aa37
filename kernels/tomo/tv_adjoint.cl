/* out = a x + D' u, where D' is scaled along each axis; without negative values if NONNEGATIVE.
 *
 * If DIRECTIONAL, u is weighed by its direction first (see differences.h).
 * `out` may be x itself. Index space: (runs of RUN samples along x, y, z).
 *
 * Buffers: image, out[nz, ny, nx], u[AXES, nz, ny, nx]. */

#include "include/portable.h"
#include "include/tomo/differences.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif
#ifndef NONNEGATIVE
#define NONNEGATIVE 0
#endif

KERNEL void tv_adjoint(
    __global const real *image, __global const real *u, __global real *out, real a,
    int nz, int ny, int nx, real scale_z, real scale_y, real scale_x,
    real m_yy, real m_yx, real m_xx)
{
  const int y = get_global_id(1), z = get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < nx ? begin + RUN : nx;
  const real scales[3] = {scale_z, scale_y, scale_x};
  for (int x = begin; x < end; x++) {
    const Place p = place_of(x, y, z, nz, ny, nx);
    real sum = a * image[p.at];
    if (DIRECTIONAL) {
      __global const real *u_y = u + (AXES - 2) * p.size, *u_x = u + (AXES - 1) * p.size;
      sum += scales[1] * (m_yy * difference_adjoint(u_y, &p, 1) + m_yx * difference_adjoint(u_x, &p, 1));
      sum += scales[2] * (m_yx * difference_adjoint(u_y, &p, 2) + m_xx * difference_adjoint(u_x, &p, 2));
      if (AXES == 3) sum += scales[0] * difference_adjoint(u, &p, 0);
    } else {
      UNROLL for (int k = 0; k < AXES; k++) {
        const int axis = k + 3 - AXES;
        sum += scales[axis] * difference_adjoint(u + k * p.size, &p, axis);
      }
    }
    out[p.at] = NONNEGATIVE && sum < 0 ? 0 : sum;
  }
}
