/* Gradient of splat_activate, with penalties that keep splats small and few.
 *
 *     dL/dlog_scale = scale (dL/dscale + scale_penalty / 3N),
 *     dL/dlogit = opacity (1 - opacity) (dL/dopacity + opacity_penalty / N):
 *
 * the penalties are those of the loss opacity_penalty mean(opacity) + scale_penalty mean(scale)
 * (3DGS as MCMC, Kheradmand et al. 2024). In place: gradients come in by what is drawn and go out by
 * what is trained. Index space: splats. */

#include "include/portable.h"

KERNEL void splat_activate_grad(
    __global const float *restrict scales, __global const float *restrict opacities,
    __global float *restrict by_scales, __global float *restrict by_opacities,
    float each_scale, float each_opacity, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  for (int k = 0; k < 3; k++) {
    const float s = scales[3 * i + k];
    by_scales[3 * i + k] = s * (by_scales[3 * i + k] + each_scale);
  }
  const float o = opacities[i];
  by_opacities[i] = o * (1 - o) * (by_opacities[i] + each_opacity);
}
