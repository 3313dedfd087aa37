/* From what is trained to what is drawn.
 *
 *     scale = exp(log_scale),    opacity = sigmoid(logit), or exp(logit) with DENSITY,
 *                                or -ln(1 - sigmoid(logit)) = ln(1 + exp(logit)) with AMPLITUDE,
 *
 * which is the optical depth that leaves alpha = sigmoid(logit) at the peak of a plain Gaussian; all
 * held inside what float32 can hold and a rasterizer can use. With BAND no splat is finer than
 * the cameras could see (the 3D filter of Mip-Splatting, Yu et al. 2024): it is blurred by a Gaussian
 * of standard deviation b, and fades as it spreads,
 *
 *     scale' = sqrt(scale^2 + b^2),    opacity' = opacity prod scale / scale'.
 *
 * Index space: splats. */

#include "include/portable.h"
#include "include/activation.h"

KERNEL void splat_activate(
    __global const float *restrict log_scales, __global const float *restrict logits,
    __global const float *restrict band, __global float *restrict scales,
    __global float *restrict opacities, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const Activation a = activated(log_scales, logits, band, i);
  for (int k = 0; k < 3; k++) scales[3 * i + k] = a.drawn[k];
  opacities[i] = a.opacity * a.faded;
}
