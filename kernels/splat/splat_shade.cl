/* Colours of splats seen from where the camera stands: spherical harmonics of the direction.
 *
 *     color = max(sum over k of Y_k(direction) sh[k] + 1/2, 0),   direction = mean - camera, unit.
 *
 * Splats that are not drawn are black, and so are those whose coefficients give no finite colour
 * (black ones pass no gradient on, so that they spoil nothing else). The colour is written to the
 * first three of STRIDE features. Index space: splats. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/seen_color.h"
#include "include/sh.h"

KERNEL void splat_shade(
    __global const float *restrict means, __global const float *restrict sh,
    __global const uchar *restrict culled, __global float *restrict features, float4 center, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  float3 color = (float3)(0, 0, 0);
  if (!culled[i]) {
    float basis[COEFFICIENTS];
    sh_basis(direction_of(load3(means, i) - center.xyz), basis);
    color = (float3)(0.5f, 0.5f, 0.5f);
    for (int k = 0; k < COEFFICIENTS; k++) color += basis[k] * load3(sh, i * COEFFICIENTS + k);
    color = color_of(color);
  }
  store3(features + i * STRIDE, 0, color);
}
