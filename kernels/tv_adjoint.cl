/* out = a x + D' u, where D' is scaled along each axis; without negative values if NONNEGATIVE.
 *
 * `out` may be x itself. Index space: (runs of RUN samples along x, y, z). */

#include "include/portable.h"
#include "include/differences.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif
#ifndef NONNEGATIVE
#define NONNEGATIVE 0
#endif

KERNEL void tv_adjoint(
    __global const real *image, __global const real *u, __global real *out, real a,
    int nz, int ny, int nx, real scale_z, real scale_y, real scale_x)
{
  const int y = get_global_id(1), z = get_global_id(2);
  const int begin = (int)get_global_id(0) * RUN, end = begin + RUN < nx ? begin + RUN : nx;
  const real scales[3] = {scale_z, scale_y, scale_x};
  for (int x = begin; x < end; x++) {
    const Place p = place_of(x, y, z, nz, ny, nx);
    real sum = a * image[p.at];
    UNROLL for (int k = 0; k < AXES; k++) {
      const int axis = k + 3 - AXES;
      sum += scales[axis] * difference_adjoint(u + k * p.size, &p, axis);
    }
    out[p.at] = NONNEGATIVE && sum < 0 ? 0 : sum;
  }
}
