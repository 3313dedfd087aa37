/* Colours of splats seen from where the camera stands: lobes about axes of the splats' own.
 *
 *     color = max(sum over k of B_k(direction; lobes) linear[k] + 1/2, 0),
 *     direction = mean - camera, unit,
 *
 * B_0 the constant of the harmonics and the others as include/lobe*.h derive them: modes on a
 * chart, or spherical Gaussians. Splats that are not drawn are black, and so are those whose
 * numbers give no finite colour or whose lobes point nowhere (black ones pass no gradient on, so
 * that they spoil nothing else). The colour is written to the first three of STRIDE features.
 *
 * Index space: splats. Each reads 3 FUNCTIONS + GEOMETRY + 3 numbers and writes 3. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/seen_color.h"
#include "include/lobe.h"

KERNEL void lobe_shade(
    __global const float *restrict means, __global const float *restrict linear,
    __global const float *restrict lobes, __global const uchar *restrict culled,
    __global float *restrict features, float4 center, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  float3 color = (float3)(0, 0, 0);
  if (!culled[i]) {
    const float3 d = direction_of(load3(means, i) - center.xyz);
    float basis[FUNCTIONS];
    basis[0] = CONSTANT;
    if (lobe_functions(lobes + i * GEOMETRY, d, basis + 1)) {
      color = (float3)(0.5f, 0.5f, 0.5f);
      for (int k = 0; k < FUNCTIONS; k++) color += basis[k] * load3(linear, i * FUNCTIONS + k);
      color = color_of(color);
    }
  }
  store3(features + i * STRIDE, 0, color);
}
