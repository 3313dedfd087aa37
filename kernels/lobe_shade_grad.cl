/* Gradient of lobe_shade: to linear coefficients and lobes, and through the direction to mean and
 * camera.
 *
 * The first is B_k times what comes in; the lobes' is derived in include/lobe*.h. Mean and camera
 * are as in splat_shade_grad.cl: only the direction's change across itself counts,
 * dL/dmean = (g - (g . d) d) / distance, which is added to grad_means, and the camera's parts gain
 *
 *     dL/dt = W^-T dL/dmean,      dL/dW = (W^-T dL/dmean) o^T,      o = -W^-1 t.
 *
 * inverse_x, _y, _z are the rows of W^-T, each followed by a coordinate of o. A colour that was
 * held at zero passes nothing on, and so no splat that is not drawn. features and grad_features
 * have STRIDE numbers for each splat, of which the first three are the colour's.
 *
 * Index space: splats. Each reads 3 FUNCTIONS + GEOMETRY + 9 numbers, writes 3 FUNCTIONS +
 * GEOMETRY, and reads and writes 3 of its mean and 12 of the camera's. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/lobe.h"

#ifndef STRIDE
#define STRIDE 3
#endif
#ifndef CAMERA_GRADIENT
#define CAMERA_GRADIENT 1
#endif

static void add3(__global float *p, long i, float3 v) { store3(p, i, load3(p, i) + v); }

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
  if (!(color.x > 0) && !(color.y > 0) && !(color.z > 0)) {
    for (int k = 0; k < 3 * FUNCTIONS; k++) grad_linear[i * 3 * FUNCTIONS + k] = 0;
    for (int k = 0; k < GEOMETRY; k++) grad_lobes[i * GEOMETRY + k] = 0;
    return;
  }
  __global const float *into = grad_features + i * STRIDE;
  const float3 incoming =
      (float3)(color.x > 0 ? into[0] : 0, color.y > 0 ? into[1] : 0, color.z > 0 ? into[2] : 0);
  const float3 center = (float3)(inverse_x.w, inverse_y.w, inverse_z.w);
  const float3 away = load3(means, i) - center;
  const float square = dot3(away, away), inverse = square > 0 ? 1 / sqrt(square) : 0;
  const float3 d = square > 0 ? away * inverse : (float3)(0, 0, 1);
  float basis[FUNCTIONS], by_basis[FUNCTIONS];
  basis[0] = CONSTANT;
  for (int k = 0; k < FUNCTIONS; k++) by_basis[k] = dot3(incoming, load3(linear, i * FUNCTIONS + k));
  float3 g = lobe_functions_grad(
      lobes + i * GEOMETRY, d, by_basis + 1, basis + 1, grad_lobes + i * GEOMETRY);
  for (int k = 0; k < FUNCTIONS; k++) store3(grad_linear, i * FUNCTIONS + k, basis[k] * incoming);
  g = (g - dot3(g, d) * d) * inverse;
  add3(grad_means, i, g);
#if CAMERA_GRADIENT
  __global float *part = camera_parts + 16 * i;
  const float3 shift = (float3)(dot3(inverse_x.xyz, g), dot3(inverse_y.xyz, g), dot3(inverse_z.xyz, g));
  add3(part, 0, shift.x * center);
  add3(part + 4, 0, shift.y * center);
  add3(part + 8, 0, shift.z * center);
  part[3] += shift.x;
  part[7] += shift.y;
  part[11] += shift.z;
#endif
}
