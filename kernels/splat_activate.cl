/* From what is trained to what is drawn: scale = exp(log_scale), opacity = sigmoid(logit).
 *
 * Both are held inside what float32 can hold and a rasterizer can use. Index space: splats. */

#include "include/portable.h"

/* ln of the smallest and the largest scale. */
#define LEAST_LOG -30.0f
#define MOST_LOG 30.0f

KERNEL void splat_activate(
    __global const float *restrict log_scales, __global const float *restrict logits,
    __global float *restrict scales, __global float *restrict opacities, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  for (int k = 0; k < 3; k++) {
    const float s = log_scales[3 * i + k];
    scales[3 * i + k] = exp(s < LEAST_LOG ? LEAST_LOG : s > MOST_LOG ? MOST_LOG : s);
  }
  opacities[i] = 1 / (1 + exp(-logits[i]));
}
