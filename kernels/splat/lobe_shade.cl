/* Colours of splats seen from where the camera stands: lobes about axes of the splats' own.
 *
 *     color = max(sum over k of B_k(direction; lobes) linear[k] + 1/2, 0),
 *     direction = mean - camera, unit,
 *
 * and the camera's axis where its rays are parallel (PARALLEL 1, which center then holds),
 * B_0 the constant of the harmonics and the others as include/shading/lobe*.h derive them: modes on a
 * chart, or spherical Gaussians. Splats that are not drawn are black, and so are those whose
 * numbers give no finite colour or whose lobes point nowhere (black ones pass no gradient on, so
 * that they spoil nothing else). The colour is written to the first three of STRIDE features.
 *
 * With LIT 1 these hold the light that a splat reflects already (light_shade.cl), which is added to the
 * sum above.
 *
 * Index space: (runs of RUN splats), LANES of them at a time. Each splat has 3 FUNCTIONS + GEOMETRY + 3
 * numbers that are read and 3 that are written.
 *
 * Buffers: means[count, 3], linear[count, FUNCTIONS, 3], lobes[count, GEOMETRY], culled[count],
 * features[count, STRIDE]. */

#include "include/portable.h"
#include "include/shading/seen_color.h"
#include "include/shading/lobe.h"

KERNEL void lobe_shade(
    __global const float *restrict means, __global const float *restrict linear,
    __global const float *restrict lobes, __global const uchar *restrict culled,
    __global float *restrict features, float4 center, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = read_bytes(culled, rows) == 0;
    lanes3 color = lanes3_of(0, 0, 0);
    if (any_lane(drawn)) {
      const lanes3 d = sight_of(read3(means, 3, rows), center.xyz).direction;
      lanes lobe[GEOMETRY], basis[FUNCTIONS];
      read_columns(lobes, GEOMETRY, 0, GEOMETRY, rows, lobe);
      basis[0] = CONSTANT;
      const lanes_int meant = lobe_functions(lobe, d, basis + 1);
      color = color_of(lit(sum_of_functions(linear, FUNCTIONS, rows, basis), features, rows), drawn & meant);
    }
    write3(features, STRIDE, rows, color);
  }
}
