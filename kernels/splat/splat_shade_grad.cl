/* Gradient of splat_shade: to the coefficients, and through the direction to mean and camera.
 *
 * The latter, told in include/seen_color.h, are added to grad_means and camera_parts. inverse_x,
 * _y, _z are the rows of W^-T, each followed by a coordinate of o. A colour that was held at zero
 * passes nothing on, and so no splat that is not drawn.
 *
 * Index space: splats. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/seen_color.h"
#include "include/sh.h"

KERNEL void splat_shade_grad(
    __global const float *restrict means, __global const float *restrict sh,
    __global const float *restrict features, __global const float *restrict grad_features,
    float4 inverse_x, float4 inverse_y, float4 inverse_z, int count, __global float *restrict grad_sh,
    __global float *restrict grad_means, __global float *restrict camera_parts)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const float3 color = load3(features + i * STRIDE, 0);
  if (is_black(color)) {
    for (int k = 0; k < 3 * COEFFICIENTS; k++) grad_sh[i * 3 * COEFFICIENTS + k] = 0;
    return;
  }
  const float3 incoming = incoming_of(color, grad_features + i * STRIDE);
  const Sight s = sight_of(load3(means, i), (float3)(inverse_x.w, inverse_y.w, inverse_z.w));
  float basis[COEFFICIENTS], by_basis[COEFFICIENTS];
  sh_basis(s.direction, basis);
  for (int k = 0; k < COEFFICIENTS; k++) {
    store3(grad_sh, i * COEFFICIENTS + k, basis[k] * incoming);
    by_basis[k] = dot3(incoming, load3(sh, i * COEFFICIENTS + k));
  }
  const float3 g = sh_basis_grad(s.direction, by_basis);
  add_by_direction(
      g, s, inverse_x.xyz, inverse_y.xyz, inverse_z.xyz, i, grad_means, camera_parts);
}
