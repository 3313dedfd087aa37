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
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: log_scales, scales[count, 3], logits, opacities[count], band[BAND ? count : 0]. */

#include "include/portable.h"
#include "include/splat/activation.h"

KERNEL void splat_activate(
    __global const float *restrict log_scales, __global const float *restrict logits,
    __global const float *restrict band, __global float *restrict scales,
    __global float *restrict opacities, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const Activation a = activated(log_scales, read_numbers(logits, rows), band, rows);
    write3(scales, 3, rows, a.drawn);
    write_numbers(opacities, rows, a.opacity * a.faded);
  }
}
