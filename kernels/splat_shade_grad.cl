/* Gradient of splat_shade: to the coefficients, and through the direction to mean and camera.
 *
 * Only the direction's change across itself counts: dL/dmean = (g - (g . d) d) / distance. It is
 * added to grad_means. The camera stands at o = -W^-1 t, so with dL/do = -dL/dmean its parts gain
 *
 *     dL/dt = W^-T dL/dmean,      dL/dW = (W^-T dL/dmean) o^T.
 *
 * inverse_x, _y, _z are the rows of W^-T, each followed by a coordinate of o. A colour that was
 * held at zero passes nothing on, and so no splat that is not drawn. features and grad_features
 * have STRIDE numbers for each splat, of which the first three are the colour's.
 *
 * Index space: splats. */

#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/sh.h"

#ifndef STRIDE
#define STRIDE 3
#endif
#ifndef CAMERA_GRADIENT
#define CAMERA_GRADIENT 1
#endif

static void add3(__global float *p, long i, float3 v) { store3(p, i, load3(p, i) + v); }

KERNEL void splat_shade_grad(
    __global const float *restrict means, __global const float *restrict sh,
    __global const float *restrict features, __global const float *restrict grad_features,
    float4 inverse_x, float4 inverse_y, float4 inverse_z, int count, __global float *restrict grad_sh,
    __global float *restrict grad_means, __global float *restrict camera_parts)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const float3 color = load3(features + i * STRIDE, 0);
  if (!(color.x > 0) && !(color.y > 0) && !(color.z > 0)) {
    for (int k = 0; k < 3 * COEFFICIENTS; k++) grad_sh[i * 3 * COEFFICIENTS + k] = 0;
    return;
  }
  __global const float *into = grad_features + i * STRIDE;
  const float3 incoming =
      (float3)(color.x > 0 ? into[0] : 0, color.y > 0 ? into[1] : 0, color.z > 0 ? into[2] : 0);
  const float3 center = (float3)(inverse_x.w, inverse_y.w, inverse_z.w);
  const float3 away = load3(means, i) - center;
  const float square = dot3(away, away), inverse = square > 0 ? 1 / sqrt(square) : 0;
  const float3 d = square > 0 ? away * inverse : (float3)(0, 0, 1);
  float basis[COEFFICIENTS], by_basis[COEFFICIENTS];
  sh_basis(d, basis);
  for (int k = 0; k < COEFFICIENTS; k++) {
    store3(grad_sh, i * COEFFICIENTS + k, basis[k] * incoming);
    by_basis[k] = dot3(incoming, load3(sh, i * COEFFICIENTS + k));
  }
  float3 g = sh_basis_grad(d, by_basis);
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
