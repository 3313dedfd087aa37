/* The lobes of a light that splats share, as the kernels that reflect it read them: rows of an axis,
 * a gap, exp of the logarithm of the radiance of three channels, a gap (include/shading/reflection.h).
 *
 * Index space: (runs of RUN lobes), LANES of them at a time.
 *
 * Buffers: axes, light[count, 3], lobes[count, LIGHT_ROW]. */

#include "include/portable.h"
#include "include/shading/reflection.h"

KERNEL void light_lobes(
    __global const float *restrict axes, __global const float *restrict light,
    __global float *restrict lobes, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes3 axis = read3(axes, 3, rows), log_radiance = read3(light, 3, rows);
    lanes row[LIGHT_ROW];
    row[0] = axis.x;
    row[1] = axis.y;
    row[2] = axis.z;
    row[3] = 0;
    row[4] = power_of_e(log_radiance.x);
    row[5] = power_of_e(log_radiance.y);
    row[6] = power_of_e(log_radiance.z);
    row[7] = 0;
    write_columns(lobes, LIGHT_ROW, 0, LIGHT_ROW, rows, row);
  }
}
