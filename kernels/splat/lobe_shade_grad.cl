/* Gradient of lobe_shade: to linear coefficients and lobes, and through the direction to mean and
 * camera.
 *
 * The first is B_k times what comes in; the lobes' is derived in include/lobe*.h. Those of mean and
 * camera, told in include/seen_color.h, are added to grad_means and camera_parts. inverse_x, _y, _z
 * are the rows of W^-T, each followed by a coordinate of o. A colour that was held at zero passes
 * nothing on, and so no splat that is not drawn.
 *
 * Index space: splats. Each reads 3 FUNCTIONS + GEOMETRY + 9 numbers, writes 3 FUNCTIONS +
 * GEOMETRY, and reads and writes 3 of its mean and 12 of the camera's. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/seen_color.h"
#include "include/lobe.h"

KERNEL void lobe_shade_grad(
    __global const float *restrict means, __global const float *restrict linear,
    __global const float *restrict lobes, __global const float *restrict features,
    __global const float *restrict grad_features, float4 inverse_x, float4 inverse_y,
    float4 inverse_z, int count, __global float *restrict grad_linear,
    __global float *restrict grad_lobes, __global float *restrict grad_means,
    __global float *restrict camera_parts)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const float3 color = load3(features + i * STRIDE, 0);
  if (is_black(color)) {
    for (int k = 0; k < 3 * FUNCTIONS; k++) grad_linear[i * 3 * FUNCTIONS + k] = 0;
    for (int k = 0; k < GEOMETRY; k++) grad_lobes[i * GEOMETRY + k] = 0;
    return;
  }
  const float3 incoming = incoming_of(color, grad_features + i * STRIDE);
  const Sight s = sight_of(load3(means, i), (float3)(inverse_x.w, inverse_y.w, inverse_z.w));
  float basis[FUNCTIONS], by_basis[FUNCTIONS];
  basis[0] = CONSTANT;
  for (int k = 0; k < FUNCTIONS; k++) by_basis[k] = dot3(incoming, load3(linear, i * FUNCTIONS + k));
  const float3 g = lobe_functions_grad(
      lobes + i * GEOMETRY, s.direction, by_basis + 1, basis + 1, grad_lobes + i * GEOMETRY);
  for (int k = 0; k < FUNCTIONS; k++) store3(grad_linear, i * FUNCTIONS + k, basis[k] * incoming);
  add_by_direction(
      g, s, inverse_x.xyz, inverse_y.xyz, inverse_z.xyz, i, grad_means, camera_parts);
}
