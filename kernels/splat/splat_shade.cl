/* Colours of splats seen from where the camera stands: spherical harmonics of the direction.
 *
 *     color = max(sum over k of Y_k(direction) sh[k] + 1/2, 0),   direction = mean - camera, unit,
 *
 * and the camera's axis where its rays are parallel (PARALLEL 1, which center then holds).
 *
 * Splats that are not drawn are black, and so are those whose coefficients give no finite colour
 * (black ones pass no gradient on, so that they spoil nothing else). The colour is written to the
 * first three of STRIDE features. With LIT 1 these hold the light that a splat reflects already
 * (light_shade.cl), which is added to the sum above.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means[count, 3], sh[count, COEFFICIENTS, 3], culled[count], features[count, STRIDE]. */

#include "include/portable.h"
#include "include/shading/seen_color.h"
#include "include/shading/sh.h"

KERNEL void splat_shade(
    __global const float *restrict means, __global const float *restrict sh,
    __global const uchar *restrict culled, __global float *restrict features, float4 center, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = read_bytes(culled, rows) == 0;
    lanes3 color = lanes3_of(0, 0, 0);
    ask_ahead(sh, COEFFICIENTS, rows);
    if (any_lane(drawn)) {
      lanes basis[COEFFICIENTS];
      sh_basis(sight_of(read3(means, 3, rows), center.xyz).direction, basis);
      color = color_of(lit(sum_of_functions(sh, COEFFICIENTS, rows, basis), features, rows), drawn);
    }
    write3(features, STRIDE, rows, color);
  }
}
